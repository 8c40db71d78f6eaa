// SPDX-License-Identifier: GPL-3.0-or-later
// Long runs: what is made of the batches, and what fails.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/rng.h"
#include "stability_long.h"

namespace probelab {
namespace {

constexpr int kBatches = 50, kReceivers = 20;

// Batches whose means scatter around a field of 1 by `scatter`, samples within them by `noise`.
LongRun noisyRun(double scatter, double noise) {
  Rng rng(5, RngStream::stability);
  const auto normal = [&] {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += rng.nextDouble();
    return sum;
  };
  LongRun run;
  run.area.assign(kReceivers, 1.0 / kReceivers);
  run.converged.assign(kReceivers, 1.0);
  for (int b = 0; b < kBatches; ++b) {
    LongBatch batch{.updates = 100 * (b + 1), .variance = noise * noise};
    for (int i = 0; i < kReceivers; ++i) batch.estimates.push_back(1 + scatter * normal());
    batch.update_ms = 2, batch.slowest_ms = 9, batch.rss_mib = 100;
    run.batches.push_back(batch);
  }
  return run;
}

std::vector<std::string> failing(const LongRun& run) {
  std::vector<std::string> ids;
  for (const LongRow& row : judgeLongRun(longNumbers(run)))
    if (row.measured.verdict == Verdict::fails) ids.emplace_back(row.id);
  return ids;
}

TEST(LongRunNumbers, AreThoseOfTheNoise) {
  const LongNumbers n = longNumbers(noisyRun(0.01, 0.1));
  EXPECT_NEAR(n.noise, 0.1, 1e-12);
  // 900 values: the deviation is known to 1 / sqrt(1800), 2.4 %; four of these.
  EXPECT_NEAR(n.expected, 0.01 * std::sqrt(2.0), 0.1 * 0.0141);
  EXPECT_LT(std::abs(n.drift), 4);
  EXPECT_EQ(n.grown_mib, 0);
  EXPECT_NEAR(n.variance_ratio, 1, 1e-12);
  EXPECT_EQ(n.slowest, 1);
}

TEST(LongRunNumbers, OfAQuietRunHold) {
  EXPECT_EQ(failing(noisyRun(0.01, 0.1)), std::vector<std::string>{});
}

TEST(LongRunNumbers, TellMemoryThatGrowsAfterTheFirstTenth) {
  LongRun run = noisyRun(0.01, 0.1);
  const auto growing = [&](const std::function<double(int)>& rss_mib) {
    for (int b = 0; b < kBatches; ++b) run.batches[b].rss_mib = rss_mib(b);
    return longNumbers(run).grown_mib;
  };
  EXPECT_EQ(growing([](int b) { return std::min(90.0 + b, 94.0); }), 0);  // while it starts
  EXPECT_EQ(growing([](int b) { return b < 20 ? 94 : 97; }), 0);          // a block, once
  EXPECT_EQ(growing([](int b) { return b == 40 ? 194 : 94; }), 0);        // and given back
  EXPECT_EQ(failing(run), std::vector<std::string>());
  EXPECT_NEAR(growing([](int b) { return 94 + 0.1 * b; }), 4.4, 1e-9);
  EXPECT_EQ(failing(run), std::vector<std::string>{"long.memory"});
  // As a container's doubling: now and then, and more each time.
  EXPECT_GT(growing([](int b) { return 94 + std::exp2(b / 8); }), 2);
  EXPECT_EQ(failing(run), std::vector<std::string>{"long.memory"});
  EXPECT_NEAR(growing([](int b) { return 94 + 1.5 * (b / 5); }), 12, 1.5);
}

TEST(LongRunNumbers, TellADriftThatNoiseHides) {
  LongRun run = noisyRun(0.01, 0.1);
  for (int b = 0; b < kBatches; ++b)
    for (double& e : run.batches[b].estimates) e += 0.01 * b / kBatches;  // 1 %, scatter 0.2 %
  EXPECT_GT(longNumbers(run).drift, 4);
  EXPECT_EQ(failing(run), std::vector<std::string>{"long.drift"});
}

TEST(LongRunNumbers, TellAFieldThatIsNotTheConvergedOne) {
  LongRun run = noisyRun(0.01, 0.1);
  for (LongBatch& batch : run.batches)
    for (double& e : batch.estimates) e *= 1.2;
  EXPECT_EQ(failing(run), std::vector<std::string>{"long.converged"});
}

TEST(LongRunNumbers, TellReceiversThatStandStillAndNoiseThatDies) {
  LongRun run = noisyRun(0.01, 0.1);
  run.batches[40].frozen = 0.05;
  EXPECT_EQ(failing(run), std::vector<std::string>{"long.stall"});
  run = noisyRun(0.01, 0.1);
  for (int b = 30; b < kBatches; ++b) run.batches[b].variance /= 4;
  EXPECT_EQ(failing(run), std::vector<std::string>{"long.stall"});
}

TEST(LongRunTrend, IsTheSlopeOverItsError) {
  // y = x and residuals 1, -2, 1 around it: slope 1, residual variance 6 / (3 - 2), over 2.
  EXPECT_NEAR(trend(std::vector<double>{1, -1, 3}), 1 / std::sqrt(6.0 / 2), 1e-12);
  EXPECT_EQ(trend(std::vector<double>{2, 2, 2, 2}), 0);
  EXPECT_LT(trend(std::vector<double>{5, 4, 3.5, 2, 1}), -10);
}

TEST(LongRunDistance, IsRelativeAndByArea) {
  LongRun run;
  run.area = {0.25, 0.75};
  // sqrt((0.25 x 4 + 0.75 x 0) / (0.25 x 1 + 0.75 x 4))
  EXPECT_NEAR(rmsDistance(run, std::vector<double>{3, 2}, std::vector<double>{1, 2}),
              std::sqrt(1 / 3.25), 1e-12);
}

}  // namespace
}  // namespace probelab
