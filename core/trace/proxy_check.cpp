// SPDX-License-Identifier: Apache-2.0
#include "trace/proxy_check.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "base/rng.h"
#include "base/timer.h"
#include "shared/light.h"
#include "trace/sampling.h"
#include "trace/surface.h"

namespace probelab {
namespace {

constexpr uint32_t kPointsPerMesh = 64;
constexpr float kClearanceMargins = 2, kDepthMargins = 6, kLeastCosine = 0.35f;

struct Point {
  uint32_t triangle;
  float u, v;
};

// What a ray hit: the mesh's name is not enough, since names may repeat.
struct MeshOf {
  std::vector<uint32_t> mesh;  // [triangle] index of its range, or as many as there are
  explicit MeshOf(const Geometry& geometry) {
    const auto count = static_cast<uint32_t>(geometry.triangles.size());
    mesh.assign(count, static_cast<uint32_t>(geometry.meshes.size()));
    for (uint32_t m = 0; m < geometry.meshes.size(); ++m) {
      const MeshRange& range = geometry.meshes[m];
      const uint32_t first = std::min(range.first_triangle, count);
      std::fill_n(mesh.begin() + first, std::min(range.triangle_count, count - first), m);
    }
  }
};

// `count` points, one from each equal share of the triangles' area.
void spreadPoints(const Geometry& geometry, const std::vector<uint32_t>& triangles, double area,
                  uint32_t count, Rng& rng, std::vector<Point>& points) {
  double passed = 0;
  uint32_t done = 0;
  for (const uint32_t triangle : triangles) {
    passed += static_cast<double>(faceArea(geometry, triangle));
    const double share = passed / area * count;
    for (; done < count && done + 0.5 < share; ++done) {
      const float a = rng.nextFloat(), b = rng.nextFloat();
      const Vec2f uv = sampleTriangle({a, b});
      points.push_back({triangle, uv.x, uv.y});
    }
  }
}

std::vector<Point> choosePoints(const Geometry& geometry, const ProxyCheckOptions& options) {
  const MeshOf meshes(geometry);
  std::vector<std::vector<uint32_t>> triangles(geometry.meshes.size() + 1);
  std::vector<double> area(triangles.size(), 0);
  double whole = 0;
  for (uint32_t t = 0; t < geometry.triangles.size(); ++t) {
    const double a = static_cast<double>(faceArea(geometry, t));
    if (!(a > 0)) continue;  // has no normal either
    triangles[meshes.mesh[t]].push_back(t);
    area[meshes.mesh[t]] += a, whole += a;
  }
  std::vector<Point> points;
  Rng rng(options.seed, RngStream::ray_proxy, 3);
  for (std::size_t m = 0; m < triangles.size(); ++m) {
    if (triangles[m].empty()) continue;
    const auto share = static_cast<uint32_t>(options.samples * (area[m] / whole));
    spreadPoints(geometry, triangles[m], area[m], std::max(share, kPointsPerMesh), rng, points);
  }
  return points;
}

struct Segment {
  Vec3f from, to;
};

enum class Passage { blocked, free, untested };

// A place on a surface and the free places that its segments join.
struct Crossing {
  Vec3f front, behind;
  Vec3f direction;  // from `front` to the point
};

class Checker {
 public:
  Checker(const Scene& scene, const EmbreeScene& embree, float margin)
      : scene_(scene), embree_(embree), margin_(margin) {}

  Crossing crossingAt(const Point& point, Rng rng) const;
  Passage passage(const Segment& segment) const;

 private:
  float freeDistance(const Vec3f& from, const Vec3f& direction) const;
  float depthBehind(const BoundedPoint& at, const Vec3f& normal, const Vec3f& inward,
                    float share) const;
  bool blockedAt(const Segment& segment, float& distance, float& cosine) const;

  const Scene& scene_;
  const EmbreeScene& embree_;
  float margin_;
};

// Metres to the next triangle; the scene's size where there is none.
float Checker::freeDistance(const Vec3f& from, const Vec3f& direction) const {
  const Hit hit = embree_.closest(Ray{from, 0, direction, kFarDistance});
  return hit.primitive == kNoHit ? embree_.extent() : hit.t;
}

// How far behind the point a free place lies: behind the wall that starts here, or, when what comes
// next is a front, between this sheet and that.
float Checker::depthBehind(const BoundedPoint& at, const Vec3f& normal, const Vec3f& inward,
                           float share) const {
  const Hit hit = embree_.closest(Ray{offsetOrigin(at, normal, inward), 0, inward, kFarDistance});
  if (hit.primitive == kNoHit) return share * embree_.extent();
  const Geometry& geometry = *scene_.geometry;
  const Vec3f other = faceNormal(geometry, hit.primitive);
  const Triangle& t = geometry.triangles[hit.primitive];
  if (scene_.materials[t.material].double_sided || dot(other, inward) <= 0) return share * hit.t;
  const BoundedPoint exit =
      pointOnTriangle(geometry.positions[t.vertex[0]], geometry.positions[t.vertex[1]],
                      geometry.positions[t.vertex[2]], hit.u, hit.v);
  return hit.t + share * freeDistance(offsetOrigin(exit, other, inward), inward);
}

Crossing Checker::crossingAt(const Point& point, Rng rng) const {
  const Geometry& geometry = *scene_.geometry;
  const auto& corners = geometry.triangles[point.triangle].vertex;
  const BoundedPoint at =
      pointOnTriangle(geometry.positions[corners[0]], geometry.positions[corners[1]],
                      geometry.positions[corners[2]], point.u, point.v);
  const Vec3f normal = faceNormal(geometry, point.triangle);
  const Frame frame = frameAround(normal);
  // Uniform over the cap of 60 degrees.
  const float cosine = 1 - 0.5f * rng.nextFloat(), sine = std::sqrt(1 - cosine * cosine);
  const float angle = 2 * std::numbers::pi_v<float> * rng.nextFloat();
  const Vec3f outward =
      normal * cosine + (frame.x * std::cos(angle) + frame.y * std::sin(angle)) * sine;
  const float before = 0.2f + 0.6f * rng.nextFloat(), after = 0.2f + 0.6f * rng.nextFloat();
  Crossing crossing;
  crossing.direction = -outward;
  crossing.front =
      at.position + outward * (before * freeDistance(offsetOrigin(at, normal, outward), outward));
  crossing.behind = at.position - outward * depthBehind(at, normal, -outward, after);
  return crossing;
}

// Whether the scene blocks the segment, and at which distance from its start first; `cosine` falls
// to that of the angle to the face's normal.
bool Checker::blockedAt(const Segment& segment, float& distance, float& cosine) const {
  const Vec3f way = segment.to - segment.from;
  const float size = length(way);
  const Hit hit = embree_.closest(Ray{segment.from, 0, way / size, size});
  distance = hit.t;
  if (hit.primitive == kNoHit) return false;
  cosine = std::min(cosine, std::abs(dot(faceNormal(*scene_.geometry, hit.primitive), way / size)));
  return true;
}

Passage Checker::passage(const Segment& segment) const {
  const Vec3f way = segment.to - segment.from;
  const float size = length(way);
  if (!(size > 2 * kClearanceMargins * margin_)) return Passage::untested;
  const Frame frame = frameAround(way / size);
  int blocked = 0;
  float nearest = kFarDistance, farthest = 0, clearance = kFarDistance, cosine = 1;
  for (int i = -1; i < 8; ++i) {
    const float angle = std::numbers::pi_v<float> / 4 * static_cast<float>(i);
    const Vec3f aside =
        i < 0 ? Vec3f() : (frame.x * std::cos(angle) + frame.y * std::sin(angle)) * margin_;
    float distance = 0, back = 0;
    if (blockedAt({segment.from + aside, segment.to + aside}, distance, cosine)) {
      ++blocked;
      blockedAt({segment.to + aside, segment.from + aside}, back, cosine);
      nearest = std::min(nearest, distance), farthest = std::max(farthest, distance);
      clearance = std::min({clearance, distance, back});
    }
    if (blocked != 0 && blocked != i + 2) return Passage::untested;
  }
  if (blocked == 0) return Passage::free;
  const bool clear = clearance >= kClearanceMargins * margin_ && cosine >= kLeastCosine;
  return clear && farthest - nearest <= kDepthMargins * margin_ ? Passage::blocked
                                                                : Passage::untested;
}

// The outcome of one point: two segments and a ray.
struct Outcome {
  Passage passage[2] = {Passage::untested, Passage::untested};
  bool proxy_blocks[2] = {false, false};
  Segment segment[2];
  enum class Comparison { none, same, other, lost } comparison = Comparison::none;
  double difference_m = 0;
};

struct Comparer {
  const Scene &scene, &proxy;
  const EmbreeScene &embree, &proxy_embree;
  MeshOf meshes, proxy_meshes;

  void compare(const Crossing& crossing, Outcome& outcome) const;
};

void Comparer::compare(const Crossing& crossing, Outcome& outcome) const {
  const Ray ray{crossing.front, 0, crossing.direction, kFarDistance};
  const Hit a = embree.closest(ray), b = proxy_embree.closest(ray);
  if (a.primitive == kNoHit) return;
  if (b.primitive == kNoHit) {
    outcome.comparison = Outcome::Comparison::lost;
    return;
  }
  const auto side = [&](const Scene& s, const Hit& hit) {
    return dot(faceNormal(*s.geometry, hit.primitive), ray.direction) > 0;
  };
  const bool same = meshes.mesh[a.primitive] == proxy_meshes.mesh[b.primitive] &&
                    scene.geometry->triangles[a.primitive].material ==
                        proxy.geometry->triangles[b.primitive].material &&
                    side(scene, a) == side(proxy, b);
  outcome.comparison = same ? Outcome::Comparison::same : Outcome::Comparison::other;
  outcome.difference_m = std::abs(static_cast<double>(a.t) - static_cast<double>(b.t));
}

void addPassage(const Outcome& outcome, int i, ProxyCheck& check) {
  if (outcome.passage[i] == Passage::untested) {
    ++check.untested;
  } else if (outcome.passage[i] == Passage::free) {
    ++check.free;
    if (outcome.proxy_blocks[i]) ++check.false_walls;
  } else {
    ++check.blocked;
    if (outcome.proxy_blocks[i]) return;
    if (check.leaks++ == 0)
      check.leak_from = outcome.segment[i].from, check.leak_to = outcome.segment[i].to;
  }
}

void summarize(const std::vector<Outcome>& outcomes, ProxyCheck& check) {
  std::vector<double> differences;
  for (const Outcome& outcome : outcomes) {
    for (int i = 0; i < 2; ++i) addPassage(outcome, i, check);
    if (outcome.comparison == Outcome::Comparison::same)
      differences.push_back(outcome.difference_m);
    if (outcome.comparison == Outcome::Comparison::other) ++check.other_surface;
    if (outcome.comparison == Outcome::Comparison::lost) ++check.lost;
  }
  check.same_surface = differences.size();
  check.median_m = percentile(differences, 0.5);
  check.p99_m = percentile(differences, 0.99);
  check.max_m = percentile(differences, 1.0);
}

bool isBlocked(const EmbreeScene& embree, const Segment& segment) {
  const Vec3f way = segment.to - segment.from;
  const float size = length(way);
  return embree.occluded(Ray{segment.from, 0, way / size, size});
}

}  // namespace

ProxyCheck checkProxy(const Scene& scene, const EmbreeScene& embree, const Scene& proxy,
                      const EmbreeScene& proxy_embree, const ProxyCheckOptions& options) {
  ProxyCheck check;
  check.margin_m = 2 * options.bound_m + 1e-5 * static_cast<double>(embree.extent());
  if (scene.geometry->triangles.empty()) return check;
  const std::vector<Point> points = choosePoints(*scene.geometry, options);
  const Checker checker(scene, embree, static_cast<float>(check.margin_m));
  const Comparer comparer{
      scene, proxy, embree, proxy_embree, MeshOf(*scene.geometry), MeshOf(*proxy.geometry)};
  std::vector<Crossing> crossings(points.size());
  std::vector<Outcome> outcomes(points.size());
  constexpr std::size_t kPointsPerTask = 256;
  parallelFor(points.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
    const FlushDenormals flush;
    for (std::size_t i = begin; i < end; ++i)
      crossings[i] = checker.crossingAt(points[i], Rng(options.seed, RngStream::ray_proxy, 4, i));
  });
  parallelFor(points.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
    const FlushDenormals flush;
    for (std::size_t i = begin; i < end; ++i) {
      Rng rng(options.seed, RngStream::ray_proxy, 5, i);
      const Crossing& other = crossings[rng.nextBelow(crossings.size())];
      Outcome& outcome = outcomes[i];
      outcome.segment[0] = {crossings[i].front, crossings[i].behind};
      outcome.segment[1] = {crossings[i].front, other.front};
      for (int s = 0; s < 2; ++s) {
        outcome.passage[s] = checker.passage(outcome.segment[s]);
        if (outcome.passage[s] != Passage::untested)
          outcome.proxy_blocks[s] = isBlocked(proxy_embree, outcome.segment[s]);
      }
      comparer.compare(crossings[i], outcome);
    }
  });
  summarize(outcomes, check);
  return check;
}

}  // namespace probelab
