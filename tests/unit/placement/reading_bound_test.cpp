// SPDX-License-Identifier: GPL-3.0-or-later
// What the best weights at every receiver could do: the minimum's own conditions, layouts for which
// the answer is known.
#include "placement/reading_bound.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "places.h"
#include "placement/training.h"

namespace probelab::test {
namespace {

// On the simplex the slope is the same wherever there is weight, and nowhere less.
TEST(SimplexMinimum, MeetsItsConditions) {
  Rng rng(7, RngStream::test);
  int corners = 0;
  for (int trial = 0; trial < 200; ++trial) {
    constexpr std::size_t kSize = 9, kRows = 14;
    std::array<std::array<double, kSize>, kRows> rows;
    std::vector<double> g(kSize * kSize, 0.0), prior(kSize, 1.0 / kSize);
    for (auto& row : rows)
      for (double& v : row) v = rng.nextDouble() - 0.3;
    double diagonal = 0;
    for (std::size_t i = 0; i < kSize; ++i)
      for (std::size_t j = 0; j < kSize; ++j) {
        for (const auto& row : rows) g[i * kSize + j] += row[i] * row[j];
        if (i == j) diagonal += g[i * kSize + j] / kSize;
      }
    const double pull = trial % 2 == 0 ? 0 : 0.3 * diagonal;
    const std::vector<double> w = simplexMinimum(g, prior, pull);
    double sum = 0, least = std::numeric_limits<double>::infinity(), most = -least;
    for (std::size_t i = 0; i < kSize; ++i) {
      double slope = pull * (w[i] - prior[i]);
      for (std::size_t j = 0; j < kSize; ++j) slope += g[i * kSize + j] * w[j];
      EXPECT_GE(w[i], 0);
      sum += w[i];
      least = std::min(least, slope);
      if (w[i] > 0) most = std::max(most, slope);
      corners += w[i] == 0 ? 1 : 0;
    }
    EXPECT_NEAR(sum, 1, 1e-12);
    EXPECT_LT(most - least, 2e-3 * diagonal);
  }
  EXPECT_GT(corners, 100);
}

struct Bounded {
  explicit Bounded(const OptionValues& options, int probes)
      : place(pillarRoom()),
        training(place.scene, place.embree, place.reachability,
                 TrainingSettings{300, 16, Split::train, 3, 128, 1}),
        layout(placeProbes("poisson", place.input(probes, 1, options))),
        bake(bakeLayout(*training.data().patches, layout, place.params, 3)),
        bound(boundReading(training.data(), layout, place.params, bake,
                           estimateLayout(training.data(), layout, place.params, bake))
                  .value()) {}
  Place place;
  Training training;
  ProbeLayout layout;
  LayoutBake bake;
  ReadingBound bound;
};

OptionValues nearestOnly() {
  return resolveOptions(findStrategy("poisson"), {"interpolant=knn", "k=1"});
}

TEST(ReadingBound, OneProbeHasNoWeightsToChoose) {
  const Bounded one(nearestOnly(), 1);
  EXPECT_GT(one.bound.nrmse, 0.1);
  EXPECT_NEAR(one.bound.unseen, one.bound.nrmse, 1e-3 * one.bound.nrmse);
  EXPECT_NEAR(one.bound.seen, one.bound.nrmse, 1e-3 * one.bound.nrmse);
}

TEST(ReadingBound, SaysThatTheNearestProbeAloneIsABadReading) {
  const Bounded many(nearestOnly(), 24);
  EXPECT_LT(many.bound.unseen, 0.95 * many.bound.nrmse);
  EXPECT_LT(many.bound.seen, 0.9 * many.bound.unseen);
}

}  // namespace
}  // namespace probelab::test
