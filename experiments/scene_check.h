// SPDX-License-Identifier: GPL-3.0-or-later
// What the program finds out about a scene before anything is computed in it: `check` prints it,
// `init` uses it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "scene/mesh_report.h"
#include "scene/scene.h"
#include "trace/embree_scene.h"
#include "trace/reachability.h"
#include "trace/wall_thickness.h"

namespace probelab {

struct SceneCheck {
  MeshReport mesh;
  SceneFeatures features;
  WallThickness wall;
  std::optional<Reachability> reachability;  // empty when it cannot be decided; see warnings
  Box3d suggested_volume;                    // world coordinates
  std::vector<std::string> warnings;
};

SceneCheck checkScene(const Scene& scene, const EmbreeScene& embree);

// World coordinates, for [volume].
Box3d suggestVolume(const Scene& scene, const std::optional<Reachability>& reachability,
                    const WallThickness& wall);

// Where a person would put a camera, in local coordinates: in the largest free region that does not
// touch the bounds or, if all such are small, in the largest one; there at eye level in the middle
// of the geometry, or where it is farthest from any wall. An unlit scene gets its light from the
// sky, which no closed region sees, so the regions that touch the bounds come first there; in such
// a region it is the place that is most enclosed. Empty without free space.
std::optional<Vec3f> findCameraPosition(const Scene& scene, const EmbreeScene& embree,
                                        const Reachability& reachability);

}  // namespace probelab
