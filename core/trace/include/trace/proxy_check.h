// SPDX-License-Identifier: Apache-2.0
// Whether a ray proxy may stand for its scene: what the scene blocks, the proxy must block.
#pragma once

#include <cstdint>

#include "scene/scene.h"
#include "trace/embree_scene.h"

namespace probelab {

struct ProxyCheckOptions {
  double bound_m = 0;  // the proxy's error bound (RayProxyReport::max_error_m)
  uint64_t seed = 0;
  uint32_t samples = 20000;  // points on the scene's surfaces
};

// A segment is tested with eight others, parallel to it at a distance of `margin_m`.
//
// It is *blocked* when the scene blocks all nine, at distances from their starts that differ by at
// most 6 margins, nowhere at a grazing angle (the first face from either end at most 69 degrees off
// its normal), and no triangle is within 2 margins of their ends along them: it passes a wall by
// more than the bound wherever the wall may have moved to, not the outlines of two things. A
// blocked segment that the proxy lets pass is a leak.
// It is *free* when the scene blocks none of the nine. A free segment that the proxy blocks is a
// false wall; a detail narrower than the margin can make a few in a good proxy.
// All others (borders, corners, narrow gaps) are not tested.
struct ProxyCheck {
  double margin_m = 0;  // twice the bound, plus 1e-5 of the scene's size for rounding
  uint64_t blocked = 0, leaks = 0;
  uint64_t free = 0, false_walls = 0;
  uint64_t untested = 0;
  Vec3f leak_from, leak_to;  // the first leak, local coordinates

  // One ray a point, to it from its front side, at most 60 degrees off the normal. Of the rays that
  // hit in both scenes, those whose hits have the same mesh, material and side; the difference of
  // their distances in metres. At 60 degrees it is twice the displacement along the normal; at a
  // silhouette a ray can reach another part of the same mesh, which the maximum shows.
  uint64_t same_surface = 0;
  double median_m = 0, p99_m = 0, max_m = 0;
  uint64_t other_surface = 0;  // another mesh, material or side
  uint64_t lost = 0;           // a hit in the scene only: at silhouettes, or through a leak

  bool holds() const { return leaks == 0; }  // else the caller should refuse the proxy
};

// Points: by area over every mesh range (and the triangles that belong to none), at least 64 on
// each, one from each equal share of its area. Two segments a point: across the surface there, from
// a random place in the free space before it to one behind the wall that starts there (a wall as
// measureWallThickness has it, or a single sheet); and between the free places of two points. So
// each region of free space is tested from all the surfaces that bound it.
ProxyCheck checkProxy(const Scene& scene, const EmbreeScene& embree, const Scene& proxy,
                      const EmbreeScene& proxy_embree, const ProxyCheckOptions& options);

}  // namespace probelab
