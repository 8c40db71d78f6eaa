// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/distance.h"

#include <CGAL/AABB_tree.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/version.h>
#if CGAL_VERSION_MAJOR >= 6
#include <CGAL/AABB_traits_3.h>
#else
#include <CGAL/AABB_traits.h>
#endif

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "trace/surface.h"

namespace probelab {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;

Kernel::Point_3 toPoint(const Vec3f& p) { return {p.x, p.y, p.z}; }

struct TriangleOfScene {
  const Geometry* geometry = nullptr;
  uint32_t id = 0;
};

// A triangle of the scene, as the tree asks for it.
class TrianglePrimitive {
 public:
  using Id = uint32_t;
  using Point = Kernel::Point_3;
  using Datum = Kernel::Triangle_3;

  TrianglePrimitive() = default;
  explicit TrianglePrimitive(const std::vector<TriangleOfScene>::const_iterator& source)
      : source_(*source) {}
  Id id() const { return source_.id; }
  Datum datum() const { return {corner(0), corner(1), corner(2)}; }
  Point reference_point() const { return corner(0); }

 private:
  Point corner(int i) const {
    const Geometry& geometry = *source_.geometry;
    return toPoint(geometry.positions[geometry.triangles[source_.id].vertex[i]]);
  }
  TriangleOfScene source_;
};

#if CGAL_VERSION_MAJOR >= 6
using Traits = CGAL::AABB_traits_3<Kernel, TrianglePrimitive>;
#else
using Traits = CGAL::AABB_traits<Kernel, TrianglePrimitive>;
#endif

using Tree = CGAL::AABB_tree<Traits>;

// A corner of every triangle, each place once: CGAL's tree of points splits space until no more than
// a few are left together, which never happens where hundreds of thousands coincide.
std::vector<Tree::Point_and_primitive_id> distinctCorners(
    const std::vector<TriangleOfScene>& triangles) {
  std::vector<Tree::Point_and_primitive_id> corners;
  corners.reserve(triangles.size());
  for (auto t = triangles.begin(); t != triangles.end(); ++t)
    corners.emplace_back(TrianglePrimitive(t).reference_point(), t->id);
  std::sort(corners.begin(), corners.end());
  const auto same_place = [](const auto& a, const auto& b) { return a.first == b.first; };
  corners.erase(std::unique(corners.begin(), corners.end(), same_place), corners.end());
  return corners;
}

}  // namespace

struct SceneDistance::Impl {
  const Geometry& geometry;
  Tree tree;
};

SceneDistance::SceneDistance(const Geometry& geometry) : impl_(new Impl{geometry, {}}) {
  if (geometry.triangles.empty()) return;
  std::vector<TriangleOfScene> triangles;
  triangles.reserve(geometry.triangles.size());
  for (uint32_t i = 0; i < geometry.triangles.size(); ++i) triangles.push_back({&geometry, i});
  impl_->tree.insert(triangles.cbegin(), triangles.cend());
  // Both now, not at the first query: queries come from many threads.
  impl_->tree.build();
  const std::vector<Tree::Point_and_primitive_id> corners = distinctCorners(triangles);
  impl_->tree.accelerate_distance_queries(corners.begin(), corners.end());
}

SceneDistance::~SceneDistance() = default;

double SceneDistance::clearance(const Vec3f& p) const {
  if (impl_->tree.empty()) return std::numeric_limits<double>::infinity();
  return std::sqrt(impl_->tree.squared_distance(toPoint(p)));
}

std::optional<ClosestPoint> SceneDistance::closest(const Vec3f& p) const {
  if (impl_->tree.empty()) return std::nullopt;
  const auto [point, triangle] = impl_->tree.closest_point_and_primitive(toPoint(p));
  ClosestPoint result;
  result.point = {point.x(), point.y(), point.z()};
  result.normal = faceNormal(impl_->geometry, triangle);
  result.distance_m = length(result.point - Vec3d(p));
  result.triangle = triangle;
  return result;
}

}  // namespace probelab
