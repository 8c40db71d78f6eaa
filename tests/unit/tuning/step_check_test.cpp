// SPDX-License-Identifier: GPL-3.0-or-later
// Cross-validation of a solution: taken whole where it is the truth, left where it is noise.
#include "tuning/step_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "tuning/solve.h"
#include "tuning_helpers.h"

namespace probelab {
namespace {

using test::innerKeys;
using test::room;

constexpr int kFolds = 4;

Params startParams() { return loadParams("probelab"); }

// The truth is the query's own answer under `truth`.
FrozenState answeredState(const Params& truth, int points) {
  return test::stateOf(test::roomSnapshot(room(), test::roomLattice(room()), truth),
                       test::roomPoints(room(), points, 12), truth);
}

void addNoise(FrozenState& state, double deviation, uint64_t seed) {
  Rng rng(seed, RngStream::test, 41);
  for (TunePoint& p : state.points) {
    const double u = std::sqrt(12.0) * (rng.nextDouble() - 0.5);
    p.truth = std::max(0.0, p.truth + deviation * state.mean * u);
  }
}

std::vector<std::vector<int>> foldsByTurns(const FrozenState& state) {
  std::vector<int> folds;
  for (std::size_t i = 0; i < state.points.size(); ++i)
    folds.push_back(static_cast<int>(i) % kFolds);
  return {folds};
}

Params solved(const TuneObjective& objective) {
  SolveSettings settings;
  settings.starts = 2, settings.candidates = 8;
  Params params = objective.base;
  setCoordinates(objective.keys, solveTuning(objective, settings).x, params);
  return params;
}

TEST(StepCheck, ASolutionThatIsTheTruthIsTakenWhole) {
  Params truth = startParams();
  truth.normal_bias = 0.23, truth.view_bias = 0.36;
  const FrozenState state = answeredState(truth, 600);
  const auto keys = innerKeys({"normal_bias", "view_bias"}, startParams());
  const TuneObjective objective{{&state, 1}, keys, startParams(), {}};
  const StepCheck check = checkStep(objective, foldsByTurns(state), kFolds, 0, solved);
  EXPECT_EQ(check.folds, kFolds);
  EXPECT_EQ(check.share, 1);
  // The folds make up the whole: before the step their costs sum to the objective's.
  const double before = scoreParams(objective, startParams()).cost;
  EXPECT_NEAR(check.costs.front(), before, 1e-12 * before);
  EXPECT_LT(check.costs.back(), 1e-3 * before);
}

// Light is right under the start's values but for noise, which the solution follows: what was left
// out is served worse by the whole step, and better by the share that is taken.
TEST(StepCheck, ASolutionThatFollowsNoiseIsNotBelieved) {
  const auto keys = innerKeys(defaultKeys(startParams()), startParams());
  double taken = 0, whole_rise = 0, taken_rise = 0;
  constexpr int kDraws = 12;
  for (uint64_t draw = 0; draw < kDraws; ++draw) {
    FrozenState state = answeredState(startParams(), 80);
    addNoise(state, 0.3, draw);
    const TuneObjective objective{{&state, 1}, keys, startParams(), {}};
    const StepCheck check = checkStep(objective, foldsByTurns(state), kFolds, 0, solved);
    const auto at = std::ranges::find(kStepShares, check.share) - std::begin(kStepShares);
    taken += check.share / kDraws;
    whole_rise += (check.costs.back() / check.costs.front() - 1) / kDraws;
    taken_rise +=
        (check.costs[static_cast<std::size_t>(at)] / check.costs.front() - 1) / kDraws;
  }
  EXPECT_GT(whole_rise, 0.01);
  EXPECT_LE(taken_rise, 0);
  EXPECT_LT(taken, 0.4);
}

// By given solutions: the folds' costs are those of their own points at each share, and of shares
// that are as good the smallest is taken.
TEST(StepCheck, SharesAreJudgedOnThePointsLeftOut) {
  Params truth = startParams();
  truth.view_bias = 0.5;
  const FrozenState state = answeredState(truth, 200);
  const auto keys = innerKeys({"view_bias"}, startParams());
  const TuneObjective objective{{&state, 1}, keys, startParams(), {}};
  Params beyond = startParams();  // the truth is near to half of the way
  beyond.view_bias = 2 * truth.view_bias - startParams().view_bias + 0.01;
  const auto found = [&](const TuneObjective&) { return beyond; };
  const StepCheck check = checkStep(objective, foldsByTurns(state), kFolds, 0, found);
  EXPECT_EQ(check.share, 0.5);
  ASSERT_EQ(check.fold_costs.size(), static_cast<std::size_t>(kFolds));
  for (std::size_t i = 0; i < std::size(kStepShares); ++i) {
    double sum = 0;
    for (const std::vector<double>& costs : check.fold_costs) sum += costs[i];
    const Params there = partOfStep(keys, startParams(), beyond, kStepShares[i]);
    EXPECT_DOUBLE_EQ(sum, check.costs[i]);
    EXPECT_NEAR(sum, scoreParams(objective, there).cost, 1e-12);
  }
  // The allowance makes a quarter do where its cost is within it.
  const double quarter = check.costs[1] / check.costs[2] - 1;
  EXPECT_EQ(checkStep(objective, foldsByTurns(state), kFolds, 1.01 * quarter, found).share, 0.25);
  // Nothing says that a step which no fold takes should be taken.
  const auto stay = [](const TuneObjective& others) { return others.base; };
  const StepCheck still = checkStep(objective, foldsByTurns(state), kFolds, 0, stay);
  EXPECT_EQ(still.share, 0);
  for (const double cost : still.costs) EXPECT_EQ(cost, still.costs.front());
}

TEST(StepCheck, FoldsWithoutPointsAreLeftOut) {
  const FrozenState state = answeredState(startParams(), 100);
  const auto keys = innerKeys({"view_bias"}, startParams());
  const TuneObjective objective{{&state, 1}, keys, startParams(), {}};
  int asked = 0;
  const auto count = [&](const TuneObjective& others) {
    ++asked;
    EXPECT_EQ(others.states.front().points.size(), 75u);
    return others.base;
  };
  // Fold 0 has 25 points, 1 to 3 none: the rest is in every problem.
  std::vector<std::vector<int>> folds = foldsByTurns(state);
  for (int& fold : folds.front())
    if (fold != 0) fold = -1;
  EXPECT_EQ(checkStep(objective, folds, kFolds, 0, count).folds, 1);
  EXPECT_EQ(asked, 1);
  // Nothing is left to solve on, or to judge: the step is not checked, and taken.
  for (const int all : {0, -1}) {
    const StepCheck check = checkStep(objective, {std::vector<int>(100, all)}, kFolds, 0, count);
    EXPECT_EQ(check.folds, 0);
    EXPECT_EQ(check.share, 1);
  }
  EXPECT_EQ(asked, 1);
}

TEST(StepCheck, PartsOfAStepAreInTheKeysCoordinates) {
  const Params from = startParams();
  Params to = from;
  to.view_bias = from.view_bias + 0.2, to.chebyshev_power = 20;
  const auto keys = innerKeys({"view_bias", "chebyshev_power"}, from);
  EXPECT_EQ(partOfStep(keys, from, to, 0).chebyshev_power, from.chebyshev_power);
  EXPECT_EQ(partOfStep(keys, from, to, 1).chebyshev_power, 20);
  const Params half = partOfStep(keys, from, to, 0.5);
  EXPECT_NEAR(half.view_bias, from.view_bias + 0.1, 1e-12);
  // Logarithmic: the half-way value lies below the mean.
  EXPECT_LT(half.chebyshev_power, (from.chebyshev_power + 20) / 2);
  EXPECT_GT(half.chebyshev_power, from.chebyshev_power);
  // What no step changes keeps its very value.
  to.chebyshev_power = from.chebyshev_power;
  EXPECT_EQ(partOfStep(keys, from, to, 0.5).chebyshev_power, from.chebyshev_power);
}

}  // namespace
}  // namespace probelab
