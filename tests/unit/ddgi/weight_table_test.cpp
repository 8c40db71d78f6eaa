// SPDX-License-Identifier: GPL-3.0-or-later
// The weight table against the lobes of the published formulas, ray by ray.
#include "ddgi/weight_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/rng.h"
#include "ddgi/directions.h"
#include "shared/octahedral.h"

namespace probelab {
namespace {

// Rays in no order at all.
std::vector<Vec3f> randomDirections(int count, uint64_t seed) {
  Rng rng(seed, RngStream::test);
  std::vector<Vec3f> directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - 2 * rng.nextDouble(), phi = 2 * std::numbers::pi * rng.nextDouble();
    const double s = std::sqrt(std::max(0.0, 1 - z * z));
    directions.push_back(Vec3f(Vec3d(s * std::cos(phi), s * std::sin(phi), z)));
  }
  return directions;
}

using Rows = std::vector<std::vector<double>>;  // [texel][ray]

// The table as a matrix; a texel must be in one block only, entries must ascend within a block.
Rows denseRows(const WeightTable& table, int texels, std::size_t rays) {
  Rows rows(static_cast<std::size_t>(texels), std::vector<double>(rays, 0.0));
  std::vector<int> seen(static_cast<std::size_t>(texels), 0);
  const auto block = static_cast<std::size_t>(table.block);
  EXPECT_EQ(table.block_texels.size(), table.blockCount() * block);
  EXPECT_EQ(table.weights.size(), table.entry_rays.size() * block);
  EXPECT_EQ(table.block_begin.back(), table.entry_rays.size());
  for (std::size_t b = 0; b < table.blockCount(); ++b)
    for (std::size_t k = 0; k < block; ++k) {
      const uint32_t texel = table.block_texels[b * block + k];
      if (texel != kNoTexel) ++seen.at(texel);
      for (uint32_t e = table.block_begin[b]; e < table.block_begin[b + 1]; ++e) {
        if (e > table.block_begin[b]) {
          EXPECT_LT(table.entry_rays[e - 1], table.entry_rays[e]);
        }
        const float weight = table.weights[e * block + k];
        if (texel == kNoTexel)
          EXPECT_EQ(weight, 0.0f);
        else
          rows[texel][table.entry_rays[e]] = static_cast<double>(weight);
      }
    }
  EXPECT_TRUE(std::all_of(seen.begin(), seen.end(), [](int n) { return n == 1; }));
  return rows;
}

// max(0, u.d)^p over all rays, normalised, nothing left out.
Rows fullLobe(const std::vector<Vec3f>& directions, int n, double exponent) {
  Rows rows;
  for (int t = 0; t < n * n; ++t) {
    const Vec3d u = texelDirection<double>(t % n, t / n, n);
    std::vector<double> row;
    double sum = 0;
    for (const Vec3f& d : directions) {
      row.push_back(std::pow(std::max(0.0, dot(u, Vec3d(d))), exponent));
      sum += row.back();
    }
    for (double& w : row) w /= sum;
    rows.push_back(row);
  }
  return rows;
}

class WeightTableOf : public ::testing::TestWithParam<int> {};

TEST_P(WeightTableOf, CosineWeightsAreTheFormula) {
  const int block = GetParam();
  for (const int n : {1, 5, 6, 12}) {
    const std::vector<Vec3f> directions = randomDirections(97, static_cast<uint64_t>(n));
    const Rows rows =
        denseRows(makeWeightTable(directions, {.texels = n}, block), n * n, directions.size());
    const Rows exact = fullLobe(directions, n, 1);
    for (std::size_t t = 0; t < rows.size(); ++t)
      for (std::size_t r = 0; r < directions.size(); ++r)
        ASSERT_NEAR(rows[t][r], exact[t][r], 1e-8) << n << " texel " << t;  // float: 2^-24 / 5
  }
}

// Every kept weight is the formula up to the normalisation; what is left out is outside the cutoff.
TEST_P(WeightTableOf, PowerWeightsAreTheFormulaInsideTheirCutoff) {
  const int block = GetParam(), n = 7;
  const double exponent = 50, cutoff = std::pow(1e-4, 1 / 51.0);
  const std::vector<Vec3f> directions = randomDirections(2000, 3);
  const Rows rows = denseRows(
      makeWeightTable(directions, {.texels = n, .exponent = exponent}, block), n * n, 2000);
  for (int t = 0; t < n * n; ++t) {
    const Vec3d u = texelDirection<double>(t % n, t / n, n);
    double sum = 0, row_sum = 0;
    for (const Vec3f& d : directions)
      if (dot(u, Vec3d(d)) > cutoff) sum += std::pow(dot(u, Vec3d(d)), exponent);
    for (std::size_t r = 0; r < 2000; ++r) {
      const double cosine = dot(u, Vec3d(directions[r]));
      const double weight = rows[static_cast<std::size_t>(t)][r];
      row_sum += weight;
      ASSERT_NEAR(weight, cosine > cutoff ? std::pow(cosine, exponent) / sum : 0, 1e-7);
    }
    EXPECT_NEAR(row_sum, 1, 1e-6);  // 60 floats of half an ulp each
  }
}

INSTANTIATE_TEST_SUITE_P(Blocks, WeightTableOf, ::testing::Values(1, 2, 4, 8, 16));

// The integral of c^p over the hemisphere below a cosine k is 2 pi k^(p+1) / (p+1): the share is
// k^(p+1), and 1e-4 of it may be lost. On a fine set of rays the sum is the integral.
TEST(WeightTable, LessThanOneTenThousandthOfALobeIsLeftOut) {
  for (const double exponent : {5.0, 50.0, 200.0}) {
    EXPECT_NEAR(std::pow(lobeCutoff(exponent), exponent + 1), 1e-4, 1e-12);
    const std::vector<Vec3f> directions = updateDirections(20000, 1, 0);
    const Rows kept = denseRows(makeWeightTable(directions, {.texels = 3, .exponent = exponent}, 1),
                                9, directions.size());
    const Rows full = fullLobe(directions, 3, exponent);
    for (std::size_t t = 0; t < 9; ++t) {
      double lost = 0;
      for (std::size_t r = 0; r < directions.size(); ++r)
        if (kept[t][r] == 0) lost += full[t][r];
      EXPECT_LT(lost, 1.1e-4) << exponent;  // 20,000 points sum the integral's tail to 10 %
      EXPECT_GT(lost, 0.5e-4) << exponent;  // and the table does use its freedom
    }
  }
}

TEST(WeightTable, ATexelWithoutARayInItsLobeTakesTheNearest) {
  const std::vector<Vec3f> directions = randomDirections(16, 4);
  const int n = 14;
  const Rows rows =
      denseRows(makeWeightTable(directions, {.texels = n, .exponent = 50}, 8), n * n, 16);
  int empty = 0;
  for (int t = 0; t < n * n; ++t) {
    const Vec3d u = texelDirection<double>(t % n, t / n, n);
    std::size_t nearest = 0;
    for (std::size_t r = 1; r < 16; ++r)
      if (dot(u, Vec3d(directions[r])) > dot(u, Vec3d(directions[nearest]))) nearest = r;
    if (dot(u, Vec3d(directions[nearest])) > std::pow(1e-4, 1 / 51.0)) continue;
    ++empty;
    for (std::size_t r = 0; r < 16; ++r)
      EXPECT_EQ(rows[static_cast<std::size_t>(t)][r], r == nearest ? 1.0 : 0.0);
  }
  EXPECT_GT(empty, n * n / 20);
}

// How texels are grouped must not matter, nor that the last tiles stick out of the map.
TEST(WeightTable, EveryBlockSizeGivesTheSameWeights) {
  const std::vector<Vec3f> directions = randomDirections(150, 5);
  for (const double exponent : {1.0, 50.0})
    for (const int n : {1, 5, 6, 7, 14}) {
      const auto rowsOf = [&](int block) {
        return denseRows(makeWeightTable(directions, {.texels = n, .exponent = exponent}, block),
                         n * n, 150);
      };
      const Rows one = rowsOf(1);
      for (const int block : {2, 4, 8, 16}) EXPECT_EQ(rowsOf(block), one) << n << " x " << block;
    }
}

// A ray that no texel of a block weighs is not in its list: that is what makes the table sparse.
TEST(WeightTable, EntriesOfSharpLobesAreFew) {
  const std::vector<Vec3f> directions = updateDirections(256, 1, 0);
  const WeightTable table = makeWeightTable(directions, {.texels = 14, .exponent = 50}, 1);
  // The cutoff cosine 0.835 encloses (1 - 0.835) / 2 = 8.3 % of the sphere.
  const double share = static_cast<double>(table.entry_rays.size()) / (256.0 * 14 * 14);
  EXPECT_NEAR(share, (1 - std::pow(1e-4, 1 / 51.0)) / 2, 0.005);
}

TEST(WeightTable, AFitIsAppliedToTheRows) {
  const std::vector<Vec3f> directions = randomDirections(60, 6);
  Eigen::MatrixXd fit = Eigen::MatrixXd::Identity(9, 9);
  fit(2, 2) = 1.25, fit(2, 7) = -0.25;
  const Rows plain = denseRows(makeWeightTable(directions, {.texels = 3}, 4), 9, 60);
  const Rows fitted = denseRows(makeWeightTable(directions, {.texels = 3, .fit = &fit}, 4), 9, 60);
  for (std::size_t t = 0; t < 9; ++t)
    for (std::size_t r = 0; r < 60; ++r)
      EXPECT_NEAR(fitted[t][r], t == 2 ? 1.25 * plain[2][r] - 0.25 * plain[7][r] : plain[t][r],
                  1e-8);
}

}  // namespace
}  // namespace probelab
