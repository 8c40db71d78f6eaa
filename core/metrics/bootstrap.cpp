// SPDX-License-Identifier: Apache-2.0
#include "metrics/bootstrap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "base/error.h"
#include "base/rng.h"
#include "validate.h"

namespace probelab {
namespace {

constexpr double kBlocksPerDiagonal = 16;

std::vector<std::size_t> drawWithReplacement(Rng& rng, std::size_t count) {
  std::vector<std::size_t> drawn(count);
  for (std::size_t& d : drawn) d = static_cast<std::size_t>(rng.nextBelow(count));
  return drawn;
}

// sqrt(first / second) of squared errors; null where neither is positive.
std::optional<double> errorRatio(double first, double second) {
  if (second > 0) return std::sqrt(std::max(0.0, first) / second);
  if (first > 0) return std::numeric_limits<double>::infinity();
  return std::nullopt;
}

// The order statistic at or outside the position q (n - 1): infinities rule out interpolation.
double orderStatistic(std::vector<double> values, double q, bool upper) {
  std::sort(values.begin(), values.end());
  const double position = q * static_cast<double>(values.size() - 1);
  return values[static_cast<std::size_t>(upper ? std::ceil(position) : std::floor(position))];
}

}  // namespace

SpatialBlocks spatialBlocks(std::span<const Vec3f> positions, const Box3f& bounds) {
  const double edge =
      Vec3d(bounds.extent()) == Vec3d() ? 1.0 : length(Vec3d(bounds.extent())) / kBlocksPerDiagonal;
  std::map<std::array<int64_t, 3>, int> numbers;
  SpatialBlocks blocks;
  for (const Vec3f& p : positions) {
    const Vec3d cell = (Vec3d(p) - Vec3d(bounds.min)) / edge;
    const std::array<int64_t, 3> key = {static_cast<int64_t>(std::floor(cell.x)),
                                        static_cast<int64_t>(std::floor(cell.y)),
                                        static_cast<int64_t>(std::floor(cell.z))};
    const auto [entry, added] = numbers.emplace(key, blocks.count);
    if (added) ++blocks.count;
    blocks.block.push_back(entry->second);
  }
  return blocks;
}

std::vector<double> blockSquaredErrors(const ReceiverSamples& samples,
                                       const SpatialBlocks& blocks) {
  validateSamples(samples);
  PROBELAB_CHECK_EQ(blocks.block.size(), samples.a.size());
  std::vector<double> errors(static_cast<std::size_t>(blocks.count), 0.0);
  double product = 0;
  for (std::size_t i = 0; i < samples.a.size(); ++i) {
    const double e = luminance(Vec3d(samples.estimate[i]));
    const double a = luminance(Vec3d(samples.a[i])), b = luminance(Vec3d(samples.b[i]));
    errors[static_cast<std::size_t>(blocks.block[i])] += samples.area[i] * (e - a) * (e - b);
    product += samples.area[i] * a * b;
  }
  if (!(product > 0))
    throw NumericalError("metrics: the reference is black, so errors relative to it do not exist");
  for (double& e : errors) e /= product;
  return errors;
}

std::optional<RatioInterval> pairedBootstrapRatio(std::span<const double> first,
                                                  std::span<const double> second, std::size_t seeds,
                                                  std::size_t blocks, uint64_t generator_seed,
                                                  int replicates) {
  PROBELAB_CHECK_EQ(first.size(), seeds * blocks);
  PROBELAB_CHECK_EQ(second.size(), seeds * blocks);
  PROBELAB_CHECK(seeds > 0 && blocks > 0 && replicates > 0);
  double first_sum = 0, second_sum = 0;
  for (std::size_t i = 0; i < first.size(); ++i) first_sum += first[i], second_sum += second[i];
  if (!(second_sum > 0)) return std::nullopt;
  std::vector<double> lows, highs;
  for (int r = 0; r < replicates; ++r) {
    Rng rng(generator_seed, RngStream::bootstrap, static_cast<uint64_t>(r));
    const std::vector<std::size_t> drawn_seeds = drawWithReplacement(rng, seeds);
    const std::vector<std::size_t> drawn_blocks = drawWithReplacement(rng, blocks);
    double f = 0, s = 0;
    for (const std::size_t seed : drawn_seeds)
      for (const std::size_t block : drawn_blocks)
        f += first[seed * blocks + block], s += second[seed * blocks + block];
    const std::optional<double> ratio = errorRatio(f, s);
    lows.push_back(ratio.value_or(0.0));
    highs.push_back(ratio.value_or(std::numeric_limits<double>::infinity()));
  }
  return RatioInterval{*errorRatio(first_sum, second_sum), orderStatistic(lows, 0.025, false),
                       orderStatistic(highs, 0.975, true)};
}

}  // namespace probelab
