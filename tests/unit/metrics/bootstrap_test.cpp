// SPDX-License-Identifier: GPL-3.0-or-later
#include "metrics/bootstrap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/rng.h"

namespace probelab {
namespace {

TEST(Bootstrap, OfEqualErrorsIsExactlyOne) {
  const std::vector<double> e = {1, 2, 3, 4, 5, 6};
  const auto interval = pairedBootstrapRatio(e, e, 2, 3);
  EXPECT_EQ(interval->ratio, 1);
  EXPECT_EQ(interval->low, 1);
  EXPECT_EQ(interval->high, 1);
  EXPECT_FALSE(interval->excludesOne());
}

TEST(Bootstrap, PairingRemovesWhatBothShare) {
  std::vector<double> second, first;
  Rng rng(3, RngStream::test);
  for (int i = 0; i < 40; ++i) second.push_back(std::exp(4 * rng.nextDouble()));
  for (const double v : second) first.push_back(4 * v);  // nrmse is twice as large in every block
  const auto interval = pairedBootstrapRatio(first, second, 4, 10);
  EXPECT_NEAR(interval->low, 2, 1e-12);
  EXPECT_NEAR(interval->high, 2, 1e-12);
  EXPECT_TRUE(interval->excludesOne());
}

TEST(Bootstrap, SameGeneratorSeedSameInterval) {
  const std::vector<double> first = {1, 5, 2, 8}, second = {2, 2, 3, 3};
  const auto a = pairedBootstrapRatio(first, second, 1, 4);
  const auto b = pairedBootstrapRatio(first, second, 1, 4);
  EXPECT_EQ(a->low, b->low);
  EXPECT_EQ(a->high, b->high);
  EXPECT_LT(a->low, a->ratio);
  EXPECT_GT(a->high, a->ratio);
}

TEST(Bootstrap, IsUndefinedWithoutAnErrorToCompareWith) {
  EXPECT_FALSE(pairedBootstrapRatio(std::vector<double>{1, 1}, std::vector<double>{0, 0}, 1, 2));
  // One block without error: replicates that draw only it have no ratio and widen both ends.
  const auto open =
      pairedBootstrapRatio(std::vector<double>{1, 0}, std::vector<double>{1, 0}, 1, 2);
  EXPECT_EQ(open->low, 0);
  EXPECT_TRUE(std::isinf(open->high));
}

TEST(Bootstrap, IntervalCoversTheTruthAsOftenAsItSays) {
  // Blocks are independent; the errors of both settings are exponential with means 1.5 and 1.
  const int datasets = 400, blocks = 60;
  const double truth = std::sqrt(1.5);
  int covered = 0;
  for (int d = 0; d < datasets; ++d) {
    Rng rng(4, RngStream::test, uint64_t(d));
    std::vector<double> first, second;
    for (int b = 0; b < blocks; ++b) {
      first.push_back(-1.5 * std::log(1 - rng.nextDouble()));
      second.push_back(-std::log(1 - rng.nextDouble()));
    }
    const auto i = pairedBootstrapRatio(first, second, 1, blocks, uint64_t(d), 400);
    covered += i->low <= truth && truth <= i->high;
  }
  // Three standard errors of a share of 0.95 in 400 are 0.033; percentile intervals of skewed data
  // fall short by the order of 1 / blocks = 0.017.
  EXPECT_GT(covered / double(datasets), 0.95 - 0.033 - 0.017);
  EXPECT_LT(covered / double(datasets), 0.95 + 0.033);
}

TEST(Blocks, AreCubesOfASixteenthOfTheDiagonal) {
  const Box3f bounds{Vec3f(-1, 0, 0), Vec3f(15, 0, 0)};  // diagonal 16, edge 1
  const std::vector<Vec3f> points = {{-0.5f, 0, 0}, {-0.1f, 0.5f, 0}, {0.1f, 0, 0}, {-0.9f, 0, 0}};
  const SpatialBlocks blocks = spatialBlocks(points, bounds);
  EXPECT_EQ(blocks.block, (std::vector<int>{0, 0, 1, 0}));
  EXPECT_EQ(blocks.count, 2);
}

TEST(Blocks, SumToTheSquaredNrmse) {
  std::vector<Vec3f> e, a, b, p;
  std::vector<float> area;
  Rng rng(5, RngStream::test);
  for (int i = 0; i < 200; ++i) {
    e.emplace_back(rng.nextFloat(), rng.nextFloat(), rng.nextFloat());
    a.emplace_back(rng.nextFloat()), b.emplace_back(rng.nextFloat());
    p.emplace_back(rng.nextFloat(), rng.nextFloat(), rng.nextFloat());
    area.push_back(rng.nextFloat());
  }
  const ReceiverSamples samples{e, a, b, p, area, {}, {}};
  const SpatialBlocks blocks = spatialBlocks(p, {Vec3f(0), Vec3f(1)});
  const std::vector<double> errors = blockSquaredErrors(samples, blocks);
  EXPECT_EQ(errors.size(), size_t(blocks.count));
  EXPECT_GT(blocks.count, 20);
  const double nrmse = *computeErrors(samples).all.nrmse;
  EXPECT_NEAR(std::accumulate(errors.begin(), errors.end(), 0.0), nrmse * nrmse, 1e-12);
}

TEST(Blocks, NeedALitReference) {
  const std::vector<Vec3f> one = {Vec3f(1)}, black = {Vec3f(0)};
  const std::vector<float> area = {1};
  const SpatialBlocks blocks = spatialBlocks(one, {Vec3f(0), Vec3f(1)});
  EXPECT_THROW(blockSquaredErrors({one, black, black, one, area, {}, {}}, blocks), NumericalError);
}

}  // namespace
}  // namespace probelab
