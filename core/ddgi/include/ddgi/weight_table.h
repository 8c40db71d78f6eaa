// SPDX-License-Identifier: Apache-2.0
// How an update's rays weigh in every texel. All probes share their directions, so there is one
// table for all of them. Texels are grouped in blocks that one invocation of the blend stage takes
// together; a block lists the rays that weigh in any of its texels.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "base/vec.h"

namespace probelab {

// The lobe that a texel averages over, around its direction.
struct Lobe {
  int texels = 0;       // interior texels a side
  double exponent = 1;  // of the cosine; 1: all of the hemisphere; else cut off where less than
                        // kDroppedShare of the lobe's integral lies outside
  const Eigen::MatrixXd* fit = nullptr;  // applied to the weights (ddgi/texel_fit.h)
};
inline constexpr double kDroppedShare = 1e-4;

// Cosine below which a power lobe counts as 0: the share of its integral below c is c^(e+1).
double lobeCutoff(double exponent);

struct WeightTable {
  int block = 0;                       // texels a block
  std::vector<uint32_t> block_begin;   // [block + 1]: first entry of each block
  std::vector<uint32_t> block_texels;  // [block][block size], kNoTexel where there is none
  std::vector<uint32_t> entry_rays;    // [entry], ascending within a block
  std::vector<float> weights;          // [entry][block size], a texel's sum over entries is 1
  uint32_t blockCount() const { return static_cast<uint32_t>(block_begin.size() - 1); }
};
inline constexpr uint32_t kNoTexel = 0xffffffffu;

// `block` is 1, 2, 4, 8 or 16. A texel whose lobe has no ray takes the nearest one.
WeightTable makeWeightTable(std::span<const Vec3f> directions, const Lobe& lobe, int block);

}  // namespace probelab
