// SPDX-License-Identifier: Apache-2.0
#include "triangle_distance.h"

#include <algorithm>
#include <cmath>

namespace probelab {
namespace {

double squaredLength(const Vec3d& v) { return dot(v, v); }

// Squared distance from a point to a box, 0 inside.
double squaredTo(const Box3d& box, const Vec3d& p) {
  const Vec3d outside = componentMax(componentMax(box.min - p, p - box.max), Vec3d(0.0));
  return squaredLength(outside);
}

double clampedShare(double part, double whole) {
  return whole > 0 ? std::clamp(part / whole, 0.0, 1.0) : 0.0;
}

// The closest point of those edges whose bit is set.
Vec2d closestOnEdges(const TrianglePoints& t, const Vec3d& p, unsigned edges) {
  Vec2d best{};
  double best_squared = std::numeric_limits<double>::infinity();
  for (int e = 0; e < 3; ++e) {
    if (!(edges >> e & 1)) continue;
    const Vec3d& a = t[e];
    const Vec3d edge = t[(e + 1) % 3] - a;
    const double s = clampedShare(dot(p - a, edge), squaredLength(edge));
    const double squared = squaredLength(a + edge * s - p);
    if (!(squared < best_squared)) continue;
    best_squared = squared;
    best = e == 0 ? Vec2d(s, 0) : e == 1 ? Vec2d(1 - s, s) : Vec2d(0, 1 - s);
  }
  return best;
}

}  // namespace

Vec2d closestOnTriangle(const TrianglePoints& t, const Vec3d& p) {
  const Vec3d ab = t[1] - t[0], ac = t[2] - t[0];
  const Vec3d n = cross(ab, ac);
  const double n_squared = squaredLength(n);
  if (n_squared > 0) {
    const Vec3d ap = p - t[0];
    const double u = dot(cross(ap, ac), n) / n_squared;
    const double v = dot(cross(ab, ap), n) / n_squared;
    // A triangle is convex: the closest point lies on an edge that p is beyond.
    const unsigned beyond = (v < 0 ? 1u : 0u) | (u + v > 1 ? 2u : 0u) | (u < 0 ? 4u : 0u);
    if (beyond == 0) return {u, v};
    return closestOnEdges(t, p, beyond);
  }
  return closestOnEdges(t, p, 7);
}

TriangleDistance::TriangleDistance(std::vector<TrianglePoints> triangles)
    : triangles_(std::move(triangles)) {
  nodes_.reserve(triangles_.size());
  if (!triangles_.empty()) build(triangles_, 0);
}

void TriangleDistance::build(std::span<TrianglePoints> triangles, uint32_t first) {
  constexpr std::size_t kLeaf = 4;
  const std::size_t index = nodes_.size();
  nodes_.emplace_back();
  Box3d box, centers;
  const auto center = [](const TrianglePoints& t) { return t[0] + t[1] + t[2]; };
  for (const TrianglePoints& t : triangles) {
    for (const Vec3d& p : t) box.extend(p);
    centers.extend(center(t));
  }
  nodes_[index].box = box;
  if (triangles.size() <= kLeaf) {
    nodes_[index].first = first, nodes_[index].count = static_cast<uint32_t>(triangles.size());
    return;
  }
  const Vec3d extent = centers.extent();
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  const std::size_t half = triangles.size() / 2;
  std::nth_element(triangles.begin(), triangles.begin() + half, triangles.end(),
                   [&](const TrianglePoints& a, const TrianglePoints& b) {
                     return center(a)[axis] < center(b)[axis];
                   });
  build(triangles.first(half), first);
  nodes_[index].right = static_cast<uint32_t>(nodes_.size());
  build(triangles.subspan(half), first + static_cast<uint32_t>(half));
}

double TriangleDistance::leafDistance(const Node& node, const Vec3d& p, double best,
                                      uint32_t& found) const {
  for (uint32_t i = node.first; i < node.first + node.count; ++i) {
    const TrianglePoints& t = triangles_[i];
    const Vec3d n = cross(t[1] - t[0], t[2] - t[0]);
    const double height = dot(p - t[0], n);  // over its plane, times the length of n
    if (height * height > best * squaredLength(n)) continue;
    const double squared = squaredLength(pointOf(t, closestOnTriangle(t, p)) - p);
    if (squared < best) best = squared, found = i;
  }
  return best;
}

bool TriangleDistance::within(const Vec3d& p, double distance_m, uint32_t& hint) const {
  const double squared = distance_m * distance_m;
  if (hint < triangles_.size()) {
    const TrianglePoints& t = triangles_[hint];
    if (squaredLength(pointOf(t, closestOnTriangle(t, p)) - p) <= squared) return true;
  }
  return search(p, squared * (1 + 1e-12), squared, hint) <= squared;
}

double TriangleDistance::search(const Vec3d& p, double best, double enough, uint32_t& found) const {
  if (nodes_.empty()) return best;
  // Halving keeps the tree's depth below 32 for as many triangles as an index can name.
  std::array<uint32_t, 64> stack;
  std::size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const uint32_t index = stack[--depth];
    const Node& node = nodes_[index];
    if (squaredTo(node.box, p) >= best) continue;
    if (node.count > 0) {
      best = leafDistance(node, p, best, found);
      if (best <= enough) return best;
      continue;
    }
    uint32_t near = index + 1, far = node.right;
    if (squaredTo(nodes_[far].box, p) < squaredTo(nodes_[near].box, p)) std::swap(near, far);
    stack[depth++] = far;
    stack[depth++] = near;
  }
  return best;
}

}  // namespace probelab
