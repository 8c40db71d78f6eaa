// SPDX-License-Identifier: Apache-2.0
// A run of triangles made ready for a half-edge mesh, which takes neither an edge of three faces
// nor two fans around one vertex: such edges are cut open and such vertices split, all of them
// locked.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/vec.h"

namespace probelab {

using Corners = std::array<uint32_t, 3>;

// For each position the smallest index of those with the same coordinates (-0 is 0).
std::vector<uint32_t> weldExactly(std::span<const Vec3f> positions);

struct Patch {
  std::vector<Corners> faces;      // [face] vertices of the patch, as many as were given
  std::vector<bool> aside;         // [face] without an area: not for the mesh
  std::vector<uint32_t> position;  // [vertex] index into `positions`
  std::vector<bool> locked;        // [vertex] on a border or a cut, or where `shared` says so
};

// `faces` hold welded indices into `positions`; `shared` [position] is true where other triangles
// of the scene meet the run.
Patch makePatch(std::span<const Corners> faces, std::span<const Vec3f> positions,
                const std::vector<bool>& shared);

}  // namespace probelab
