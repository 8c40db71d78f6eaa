// SPDX-License-Identifier: GPL-3.0-or-later
// The regular lattice: geometry alone, instant; and what the other lattices share with it.
#pragma once

#include "placement/strategy.h"

namespace probelab {

extern const Strategy kGridStrategy;

// What that strategy's options ask for, before points are left out.
Lattice gridLattice(const PlacementInput& input);

// Counts n with 0.9 N <= n.x n.y n.z <= N whose cells in a box with these edges are nearest to
// cubes, stretched along y by `vertical` (smallest spread of the logarithms of the cell's edges;
// more probes on a tie, then the shortest longest edge a probe: 2 divide the longest axis).
Vec3i cubicCounts(const Vec3f& edges, int probes, double vertical = 1);

// Up to `most` of these counts, nearest to cubes first.
std::vector<Vec3i> likelyCounts(const Vec3f& edges, int probes, std::size_t most);

// Where a lattice lies: in the free-space box or the bounds, kept away from the box's faces by
// `inset` spacings (on axes with more than one point) or by `margin_m` metres.
struct LatticeBox {
  bool free_space = true;
  double inset = 0;
  double margin_m = 0;
  bool operator==(const LatticeBox&) const = default;
};

// The box before its inset: what counts are fitted to. Never flat: where the reachable free space
// has no extent, the bounds stand in.
Box3f outerBox(const PlacementInput& input, const LatticeBox& box);
Lattice latticeIn(const PlacementInput& input, const LatticeBox& box, const Vec3i& count);

// Boxes worth trying: the bounds; the bounds less half a spacing; the free-space box with insets of
// 0.05, 0.15, 0.3 and 0.5 spacings, and of 12 cm where there is room for them.
std::vector<LatticeBox> likelyBoxes(const PlacementInput& input);

// 1 for the lattice points that can matter (isUsable).
std::vector<uint8_t> usablePoints(const Lattice& lattice, const PlacementInput& input);

// The layout of the lattice's usable points. Where there is none (a single point in a wall), one
// probe in the roomiest place of the free space instead.
ProbeLayout usableLayout(const Lattice& lattice, const PlacementInput& input);

}  // namespace probelab
