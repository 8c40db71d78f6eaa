// SPDX-License-Identifier: Apache-2.0
// The thinnest wall of a scene, measured by rays: what decides how much a probe field can leak.
#pragma once

#include <cstdint>

#include "scene/scene.h"
#include "trace/embree_scene.h"

namespace probelab {

// From points of every face a ray goes inward; the back side that it meets first is the wall's
// other face, if the two normals are within 60 degrees of opposite.
struct WallThickness {
  bool has_walls = false;  // some face has another one behind it
  float thinnest_m = 0;    // smallest distance found, 0 when has_walls is false
  Vec3f place;             // on the front face, local coordinates
  double sheet_share = 0;  // share of the area behind which there is no other face (single sheets)
};

// `samples` points by area, and the middle of every triangle (of the first `samples` ones). A wall
// that is thin only over less than about 1 / samples of the area can be missed.
WallThickness measureWallThickness(const Scene& scene, const EmbreeScene& embree,
                                   uint32_t samples = 20000);

}  // namespace probelab
