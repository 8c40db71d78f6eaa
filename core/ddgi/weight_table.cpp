// SPDX-License-Identifier: Apache-2.0
#include "ddgi/weight_table.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "shared/octahedral.h"

namespace probelab {
namespace {

using Weights = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// One texel's normalised weights over all rays.
void fillRow(std::span<const Vec3f> directions, const Vec3d& axis, double exponent, double cutoff,
             Eigen::Ref<Eigen::RowVectorXd> row) {
  double sum = 0, nearest_cosine = -2;
  Eigen::Index nearest = 0;
  for (std::size_t r = 0; r < directions.size(); ++r) {
    const double cosine = dot(axis, Vec3d(directions[r]));
    const auto at = static_cast<Eigen::Index>(r);
    if (cosine > nearest_cosine) nearest_cosine = cosine, nearest = at;
    row[at] = 0;
    if (cosine <= cutoff) continue;
    row[at] = exponent == 1 ? cosine : std::pow(cosine, exponent);
    sum += row[at];
  }
  if (sum > 0)
    row /= sum;
  else
    row[nearest] = 1;
}

Weights texelWeights(std::span<const Vec3f> directions, const Lobe& lobe) {
  const double cutoff = lobe.exponent == 1 ? 0 : lobeCutoff(lobe.exponent);
  const int n = lobe.texels;
  Weights weights(n * n, static_cast<Eigen::Index>(directions.size()));
  parallelFor(static_cast<std::size_t>(n * n), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const int texel = static_cast<int>(t);
      const Vec3d axis = texelDirection(static_cast<double>(texel % n),
                                        static_cast<double>(texel / n), static_cast<double>(n));
      fillRow(directions, axis, lobe.exponent, cutoff, weights.row(texel));
    }
  });
  if (lobe.fit != nullptr) weights = (*lobe.fit) * weights;
  return weights;
}

struct Tile {
  int width, height;
};
Tile tileOf(int block) {
  int width = 1, height = 1;
  while (width * height < block) (width <= height ? width : height) *= 2;
  PROBELAB_CHECK_EQ(width * height, block);
  return {width, height};
}

}  // namespace

double lobeCutoff(double exponent) { return std::pow(kDroppedShare, 1 / (exponent + 1)); }

WeightTable makeWeightTable(std::span<const Vec3f> directions, const Lobe& lobe, int block) {
  const Weights weights = texelWeights(directions, lobe);
  const Tile tile = tileOf(block);
  const int n = lobe.texels;
  WeightTable table;
  table.block = block;
  table.block_begin.push_back(0);
  for (int y = 0; y < n; y += tile.height)
    for (int x = 0; x < n; x += tile.width) {
      const std::size_t first = table.block_texels.size();
      for (int k = 0; k < block; ++k) {
        const int tx = x + k % tile.width, ty = y + k / tile.width;
        table.block_texels.push_back(tx < n && ty < n ? static_cast<uint32_t>(ty * n + tx)
                                                      : kNoTexel);
      }
      const std::span<const uint32_t> texels(&table.block_texels[first],
                                             static_cast<std::size_t>(block));
      for (Eigen::Index r = 0; r < weights.cols(); ++r) {
        const auto weightOf = [&](uint32_t t) { return t == kNoTexel ? 0.0 : weights(t, r); };
        if (std::all_of(texels.begin(), texels.end(), [&](uint32_t t) { return weightOf(t) == 0; }))
          continue;
        table.entry_rays.push_back(static_cast<uint32_t>(r));
        for (const uint32_t t : texels) table.weights.push_back(static_cast<float>(weightOf(t)));
      }
      table.block_begin.push_back(static_cast<uint32_t>(table.entry_rays.size()));
    }
  return table;
}

}  // namespace probelab
