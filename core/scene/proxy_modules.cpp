// SPDX-License-Identifier: Apache-2.0
#include "proxy_modules.h"

#include <cmath>
#include <limits>

namespace probelab {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Long fans and slivers make poor bounding volumes and, beyond 1 : 1,000, poor ray origins
// (shared/offset.h).
constexpr int kMaxValence = 32;
constexpr double kMinShape = 1.0 / 400;

double longestEdge(const TrianglePoints& t) {
  return std::max({length(t[1] - t[0]), length(t[2] - t[0]), length(t[2] - t[1])});
}

// Twice the area over the longest edge squared: the height over that edge.
double shape(const TrianglePoints& t) {
  const double longest = longestEdge(t);
  return longest > 0 ? length(cross(t[1] - t[0], t[2] - t[0])) / (longest * longest) : 0;
}

Vec3d weigh(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec2d& weights) {
  return a * (1 - weights.x - weights.y) + b * weights.x + c * weights.y;
}

}  // namespace

void ProxyAttributes::setUp(const Geometry& geometry, const DecimateSettings& settings,
                            std::vector<Corners> corners,
                            std::vector<std::array<int, 3>> vertices) {
  geometry_ = &geometry;
  settings_ = settings;
  slack_m_ = 1e-6 * static_cast<double>(geometry.box.diagonal());  // a few roundings of fp32
  min_cos_turn_ = std::cos(settings.normal_turn_rad);
  corners_ = std::move(corners);
  vertices_ = std::move(vertices);
  samples_.assign(corners_.size(), {});
  hints_.assign(corners_.size(), 0);
  has_attributes_ = !geometry.normals.empty() || settings.uv0 || settings.uv1;
}

uint32_t ProxyAttributes::cornerAt(int face, int vertex) const {
  const auto f = static_cast<std::size_t>(face);
  for (std::size_t k = 0; k < 3; ++k)
    if (vertices_[f][k] == vertex) return corners_[f][k];
  return std::numeric_limits<uint32_t>::max();
}

bool ProxyAttributes::normalHolds(const MovedFace& moved, const Vec2d& weights,
                                  uint32_t vertex) const {
  if (geometry_->normals.empty()) return true;
  const auto normal = [&](uint32_t i) { return Vec3d(geometry_->normals[i]); };
  const Vec3d before = normal(vertex);
  const Vec3d after =
      weigh(normal(moved.corners[0]), normal(moved.corners[1]), normal(moved.corners[2]), weights);
  const double lengths = length(before) * length(after);
  // A face's own normal (zero vectors) is the geometry's matter, but not to be mixed with others.
  if (!(lengths > 1e-6)) return length(before) < 1e-6 && length(after) < 1e-6;
  return dot(before, after) >= min_cos_turn_ * lengths;
}

double ProxyAttributes::textureMiss(const MovedFace& moved, const Vec2d& weights, uint32_t vertex,
                                    const std::vector<Vec2f>& uv) const {
  if (uv.empty()) return 0;
  const Vec2d u0(uv[moved.corners[0]]);
  const Vec2d a = Vec2d(uv[moved.corners[1]]) - u0, b = Vec2d(uv[moved.corners[2]]) - u0;
  const Vec2d off = u0 + a * weights.x + b * weights.y - Vec2d(uv[vertex]);
  if (dot(off, off) == 0) return 0;
  const double det = a.x * b.y - a.y * b.x;
  if (det == 0) return kInfinity;
  // `off` in barycentric weights, then in metres along the face.
  const double s = (off.x * b.y - off.y * b.x) / det, t = (a.x * off.y - a.y * off.x) / det;
  return length((moved.points[1] - moved.points[0]) * s + (moved.points[2] - moved.points[0]) * t);
}

double ProxyAttributes::miss(const MovedFace& moved, uint32_t vertex) const {
  const Vec3d p(geometry_->positions[vertex]);
  const Vec2d weights = closestOnTriangle(moved.points, p);
  double worst = length(pointOf(moved.points, weights) - p);
  if (worst > settings_.max_error_m + slack_m_) return kInfinity;
  if (!normalHolds(moved, weights, vertex)) return kInfinity;
  if (settings_.uv0) worst = std::max(worst, textureMiss(moved, weights, vertex, geometry_->uv0));
  if (settings_.uv1) worst = std::max(worst, textureMiss(moved, weights, vertex, geometry_->uv1));
  return worst <= settings_.max_error_m + slack_m_ ? worst : kInfinity;
}

bool ProxyAttributes::moveFace(const ProxyCollapse& collapse, int face, uint32_t corner,
                               MovedFace& moved) const {
  const auto f = static_cast<std::size_t>(face);
  moved.face = face;
  moved.corners = corners_[f];
  TrianglePoints before;
  for (std::size_t k = 0; k < 3; ++k) {
    before[k] = toVec(collapse.mesh.point(ProxyMesh::VertexHandle(vertices_[f][k])));
    moved.points[k] = before[k];
    if (vertices_[f][k] != collapse.v0.idx()) continue;
    moved.corners[k] = corner;
    moved.points[k] = toVec(collapse.p1);
    moved.slot = k;
  }
  return shape(moved.points) >= std::min(kMinShape, shape(before)) &&
         longestEdge(moved.points) <= std::max(settings_.max_edge_m, longestEdge(before));
}

// Edges at v0 where the faces on both sides disagree about the attributes of an end.
int ProxyAttributes::seamsAround(const ProxyCollapse& collapse) const {
  int seams = 0;
  for (auto it = collapse.mesh.voh_iter(collapse.v0); it.is_valid(); ++it) {
    const int face = collapse.mesh.face_handle(*it).idx();
    const int other = collapse.mesh.opposite_face_handle(*it).idx();
    const int end = collapse.mesh.to_vertex_handle(*it).idx();
    const int v0 = collapse.v0.idx();
    if (cornerAt(face, v0) != cornerAt(other, v0) || cornerAt(face, end) != cornerAt(other, end))
      ++seams;
  }
  return seams;
}

// What the collapse makes of the faces around v0, and which vertices they must then account for.
// False when it cannot keep the attributes or makes slivers.
bool ProxyAttributes::plan(const ProxyCollapse& collapse, std::vector<MovedFace>& moved,
                           std::vector<uint32_t>& samples) const {
  if (collapse.mesh.is_boundary(collapse.v0)) return false;  // locked anyway
  const int v0 = collapse.v0.idx(), v1 = collapse.v1.idx();
  const int left = collapse.fl.idx(), right = collapse.fr.idx();
  const uint32_t from_left = cornerAt(left, v0), from_right = cornerAt(right, v0);
  const uint32_t to_left = cornerAt(left, v1), to_right = cornerAt(right, v1);
  // On a seam v0 moves along it, and where one ends or branches it stays.
  const int seams = seamsAround(collapse);
  if (seams != 0 && (seams != 2 || from_left == from_right || to_left == to_right)) return false;
  if (has_attributes_) samples.push_back(from_left);
  if (has_attributes_ && from_right != from_left) samples.push_back(from_right);
  for (auto it = collapse.mesh.vf_iter(collapse.v0); it.is_valid(); ++it) {
    const int face = it->idx();
    const auto& kept = samples_[static_cast<std::size_t>(face)];
    samples.insert(samples.end(), kept.begin(), kept.end());
    if (face == left || face == right) continue;
    const uint32_t from = cornerAt(face, v0);
    if (from != from_left && from != from_right) return false;  // a corner of three seams
    moved.emplace_back();
    if (!moveFace(collapse, face, from == from_left ? to_left : to_right, moved.back()))
      return false;
  }
  return !moved.empty();
}

bool ProxyAttributes::samplesHold(const std::vector<MovedFace>& moved,
                                  const std::vector<uint32_t>& samples) const {
  return std::all_of(samples.begin(), samples.end(), [&](uint32_t vertex) {
    return std::any_of(moved.begin(), moved.end(),
                       [&](const MovedFace& m) { return miss(m, vertex) < kInfinity; });
  });
}

// Whether the centroids and the new edges' middles lie within the bound of the original surface
// (what lies between is measured when all is done). In a plane a fan that turns no face over covers
// what it replaces, so nothing has to be asked there.
bool ProxyAttributes::staysNear(const ProxyCollapse& collapse,
                                const std::vector<MovedFace>& moved) {
  const double bound_m = settings_.max_error_m + slack_m_;
  const TrianglePoints& first = moved.front().points;
  const Vec3d normal = normalize(cross(first[1] - first[0], first[2] - first[0]));
  const auto isInPlane = [&](const Vec3d& p) {
    return std::abs(dot(p - first[0], normal)) <= 1e-3 * settings_.max_error_m + slack_m_;
  };
  bool flat = isInPlane(toVec(collapse.p0));
  for (const MovedFace& m : moved)
    for (const Vec3d& p : m.points) flat = flat && isInPlane(p);
  if (flat) return true;
  return std::all_of(moved.begin(), moved.end(), [&](const MovedFace& m) {
    const auto& [a, b, c] = m.points;
    const Vec3d edge_middle = (m.points[m.slot] + m.points[(m.slot + 1) % 3]) * 0.5;
    uint32_t& hint = hints_[static_cast<std::size_t>(m.face)];
    return settings_.original->within((a + b + c) / 3.0, bound_m, hint) &&
           settings_.original->within(edge_middle, bound_m, hint);
  });
}

float ProxyAttributes::collapse_priority(const ProxyCollapse& collapse) {
  std::vector<MovedFace> moved;
  std::vector<uint32_t> samples;
  const int valence = static_cast<int>(collapse.mesh.valence(collapse.v0)) +
                      static_cast<int>(collapse.mesh.valence(collapse.v1)) - 4;
  if (valence > std::max(kMaxValence, static_cast<int>(collapse.mesh.valence(collapse.v1))))
    return Base::ILLEGAL_COLLAPSE;
  if (!plan(collapse, moved, samples)) return Base::ILLEGAL_COLLAPSE;
  const bool holds = samplesHold(moved, samples) && staysNear(collapse, moved);
  return static_cast<float>(holds ? Base::LEGAL_COLLAPSE : Base::ILLEGAL_COLLAPSE);
}

void ProxyAttributes::preprocess_collapse(const ProxyCollapse& collapse) {
  std::vector<MovedFace> moved;
  std::vector<uint32_t> samples;
  plan(collapse, moved, samples);
  for (const MovedFace& m : moved) {
    const auto f = static_cast<std::size_t>(m.face);
    corners_[f] = m.corners;
    std::replace(vertices_[f].begin(), vertices_[f].end(), collapse.v0.idx(), collapse.v1.idx());
    samples_[f].clear();
  }
  for (const uint32_t vertex : samples) {
    double best = kInfinity;
    const MovedFace* at = nullptr;
    for (const MovedFace& m : moved)
      if (const double d = miss(m, vertex); d < best) best = d, at = &m;
    if (at) samples_[static_cast<std::size_t>(at->face)].push_back(vertex);
  }
}

}  // namespace probelab
