// SPDX-License-Identifier: Apache-2.0
// The decimation of one patch with OpenMesh; the only header-side view of it, free of OpenMesh.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "proxy_patch.h"
#include "scene/scene.h"
#include "triangle_distance.h"

namespace probelab {

struct DecimateSettings {
  double max_error_m = 0;                      // tolerance of ModHausdorff and of textures
  double normal_turn_rad = 0;                  // of shading normals
  double max_edge_m = 0;                       // of a triangle that changes
  const TriangleDistance* original = nullptr;  // the patch's triangles, not to be left
  bool uv0 = false, uv1 = false;  // texture coordinates that the patch's material reads
};

// corners: [face] the geometry's vertices, one index for all vertices of a place with the same
// attributes. Answers the faces that remain, by the same vertices, at the places of the faces that
// they come from; nothing where a face is gone.
std::vector<std::optional<Corners>> decimatePatch(const Geometry& geometry, const Patch& patch,
                                                  std::span<const Corners> corners,
                                                  const DecimateSettings& settings);

}  // namespace probelab
