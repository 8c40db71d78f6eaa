// SPDX-License-Identifier: Apache-2.0
// Does one setting beat another? A 95 % interval of the ratio of their nrmse, by a paired bootstrap
// over spatial blocks (probe errors are correlated in space) and seeds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/vec.h"
#include "metrics/error.h"

namespace probelab {

// Cubes with an edge of 1/16 of the bounds' diagonal, numbered densely in the order of appearance.
struct SpatialBlocks {
  std::vector<int> block;  // per position
  int count = 0;
};
SpatialBlocks spatialBlocks(std::span<const Vec3f> positions, const Box3f& bounds);

// Per block: Σ a (Ê-A)(Ê-B) over its receivers / Σ a A B over all; the blocks sum to nrmse² (before
// its max with 0). Throws NumericalError where Σ a A B is not positive, and as computeErrors does.
std::vector<double> blockSquaredErrors(const ReceiverSamples& samples, const SpatialBlocks& blocks);

struct RatioInterval {
  double ratio = 0;          // of all blocks and seeds
  double low = 0, high = 0;  // percentiles 2.5 and 97.5
  bool excludesOne() const { return low > 1 || high < 1; }
};

// Ratio of the nrmse of `first` to that of `second`, each the root of the mean over seeds of the
// squared error. Arrays are [seed][block] of blockSquaredErrors, paired by seed and block, which
// are drawn with replacement and independently of each other. Null where the ratio is undefined
// (the second error is not positive). A replicate in which it is undefined widens the interval on
// both sides. The generator's seed is fixed unless given.
std::optional<RatioInterval> pairedBootstrapRatio(std::span<const double> first,
                                                  std::span<const double> second, std::size_t seeds,
                                                  std::size_t blocks, uint64_t generator_seed = 1,
                                                  int replicates = 2000);

}  // namespace probelab
