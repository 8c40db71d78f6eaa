// SPDX-License-Identifier: GPL-3.0-or-later
// Layouts of probes that lie on no lattice: what all such strategies share.
#pragma once

#include <vector>

#include "placement/free_space.h"
#include "placement/wall_pieces.h"

namespace probelab {

// interpolant, k, sharpness, cutoff, visibility, walls and cells, to be put behind a strategy's own
// options.
std::vector<StrategyOption> scatteredOptions(std::vector<StrategyOption> own = {});

// Throws InputError for a bad one, before anything takes time.
void checkScatteredOptions(const PlacementInput& input);

// What these probes weigh, as the options of `scatteredOptions` in the input say.
struct ScatteredWeights {
  Interpolant interpolant{};
  Lattice corners;
  VoxelPieces pieces;  // any(): with walls
  CornerWeights weights;
};
// Walls that were found for a grid of corners, for strategies that make many layouts.
struct KnownWalls {
  Lattice corners;
  WallPieces walls;
};
// `known` is used where it fits, else filled in; or null.
ScatteredWeights scatteredWeights(const FreeSpace& space, const std::vector<Vec3f>& positions,
                                  KnownWalls* known = nullptr);

// The layout of these probes, read as the options of `scatteredOptions` in the input say.
// `pinned` is empty or as long as the positions. Throws InputError for a bad option.
ProbeLayout scatterProbes(const FreeSpace& space, std::vector<Vec3f> positions,
                          std::vector<uint8_t> pinned = {}, KnownWalls* known = nullptr);

}  // namespace probelab
