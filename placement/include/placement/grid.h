// SPDX-License-Identifier: GPL-3.0-or-later
// The regular lattice: geometry alone, instant; and what the other lattices share with it.
#pragma once

#include "placement/strategy.h"

namespace probelab {

extern const Strategy kGridStrategy;

// Counts n with 0.9 N <= n.x n.y n.z <= N whose cells in a box with these edges are nearest to
// cubes, stretched along y by `vertical` (smallest spread of the logarithms of the cell's edges;
// more probes on a tie).
Vec3i cubicCounts(const Vec3f& edges, int probes, double vertical = 1);

// The box of a lattice with these counts that keeps `inset` spacings to the given box on every
// axis with more than one point: spacing = edge / (n - 1 + 2 inset).
Box3f insetBox(const Box3f& box, const Vec3i& count, double inset);

// The box of the reachable free space, never flat: an axis without extent takes the bounds' one.
Box3f freeSpaceBox(const PlacementInput& input);

// 1 for the lattice points that can matter: in free space connected to the reachable region.
std::vector<uint8_t> reachablePoints(const Lattice& lattice, const PlacementInput& input);

}  // namespace probelab
