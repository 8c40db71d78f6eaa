// SPDX-License-Identifier: GPL-3.0-or-later
// The regular lattice: geometry alone, instant.
#pragma once

#include "placement/strategy.h"

namespace probelab {

extern const Strategy kGridStrategy;

// Counts n with 0.9 N <= n.x n.y n.z <= N whose cells in a box with these edges are nearest to
// cubes, stretched along y by `vertical` (smallest spread of the logarithms of the cell's edges;
// more probes on a tie).
Vec3i cubicCounts(const Vec3f& edges, int probes, double vertical = 1);

// 1 for the lattice points that can matter: in free space connected to the reachable region.
std::vector<uint8_t> reachablePoints(const Lattice& lattice, const PlacementInput& input);

}  // namespace probelab
