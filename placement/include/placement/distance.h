// SPDX-License-Identifier: GPL-3.0-or-later
// Distances to the scene's triangles, in double, by an AABB tree (CGAL). Part of builds with CGAL.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "base/vec.h"
#include "scene/scene.h"

namespace probelab {

// The point of the mesh that lies nearest to a place.
struct ClosestPoint {
  Vec3d point;
  Vec3f normal;  // of its triangle, counter-clockwise side
  double distance_m = 0;
  uint32_t triangle = 0;
};

// Everything is const and may be called from any thread. Holes of alpha-masked materials count as
// surface.
class SceneDistance {
 public:
  // `geometry` is kept; it may be without triangles.
  explicit SceneDistance(const Geometry& geometry);
  ~SceneDistance();
  SceneDistance(const SceneDistance&) = delete;
  SceneDistance& operator=(const SceneDistance&) = delete;

  // Metres to the nearest triangle; infinity without any.
  double clearance(const Vec3f& p) const;
  // Empty without triangles.
  std::optional<ClosestPoint> closest(const Vec3f& p) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace probelab
