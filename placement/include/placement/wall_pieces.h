// SPDX-License-Identifier: GPL-3.0-or-later
// How walls divide the voxels of an index, and which places stand for a corner on either side.
#pragma once

#include <vector>

#include "ddgi/influence.h"
#include "placement/free_space.h"

namespace probelab {

struct WallPieces {
  VoxelPieces pieces;
  // [list of weights]: the places that stand for it. Lists of the grid's corners come first, in
  // their order; where nothing but the corner itself stands for one it is that corner.
  std::vector<std::vector<Vec3f>> viewpoints;
  std::vector<uint32_t> corner;  // [list]: the corner of the grid that it belongs to
};

// Each voxel is looked at through a sample of the usable places in it, also a thousandth of its edge
// inside its faces. Those that see each other, directly or by way of others, belong together. Two
// groups are two pieces if the plane of a surface between them separates them; more groups, or
// groups that no plane separates, stay one piece. Pieces on both sides of a voxel's face go together where a place of one sees a place of
// the other: at the face's corners they share their lists of weights, so weights are continuous
// wherever there is a way through that the samples find (gaps below a quarter of a voxel may be
// missed). Parallel; the same grid and scene give the same pieces.
WallPieces findWallPieces(const Lattice& corners, const FreeSpace& space);

}  // namespace probelab
