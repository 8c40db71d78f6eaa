// SPDX-License-Identifier: GPL-3.0-or-later
// The solver on fields whose best parameters are known, and against exhaustive scans.
#include "tuning/solve.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/parallel.h"
#include "tuning_helpers.h"

namespace probelab {
namespace {

using test::innerKeys;
using test::room;
using test::roomPoints;
using test::RoomScene;
using test::roomSnapshot;
using test::stateOf;

Params knownParams(const std::string& preset) {
  Params truth = loadParams(preset);
  truth.normal_bias = 0.23, truth.view_bias = 0.36;
  return truth;
}

// Points whose truth is the query's own answer under known parameters.
FrozenState knownState(const Params& truth, bool lattice = true, int points = 600) {
  const ProbeLayout layout = lattice ? test::roomLattice(room()) : test::roomScattered(room());
  return stateOf(roomSnapshot(room(), layout, truth), roomPoints(room(), points, 11), truth);
}

double worstBias(const std::vector<double>& x, const std::vector<double>& wanted) {
  return std::max(std::abs(x[0] - wanted[0]), std::abs(x[1] - wanted[1]));
}

void expectBiasesRecovered(const std::string& preset, bool lattice) {
  const Params truth = knownParams(preset);
  const FrozenState state = knownState(truth, lattice);
  const Params base = loadParams(preset);
  const auto keys = innerKeys({"normal_bias", "view_bias"}, base);
  const std::vector<double> wanted = toCoordinates(keys, truth);
  const TuneObjective objective{{&state, 1}, keys, base, {}};
  const SolveResult result = solveTuning(objective, {});
  EXPECT_LT(worstBias(result.x, wanted), 0.02) << preset << lattice;
  int recovered = 0;
  const std::size_t starts = result.paths.size() - 1;
  for (std::size_t i = 0; i < starts; ++i)
    if (worstBias(result.paths[i].steps.back().x, wanted) < 0.02) ++recovered;
  EXPECT_GE(2 * recovered, static_cast<int>(starts)) << preset << lattice;
}

TEST(SolveTuning, KnownBiasesAreRecoveredByTheBestAndByHalfOfTheStarts) {
  expectBiasesRecovered("rtxgi", true);
  expectBiasesRecovered("probelab", true);
  expectBiasesRecovered("probelab", false);
}

TEST(SolveTuning, AllSixParametersTogetherRecoverTheIrradiance) {
  for (const char* preset : {"rtxgi", "probelab"}) {
    Params truth = knownParams(preset);
    truth.visibility_floor = 0.02, truth.chebyshev_power = 2, truth.facing_offset = 0.1;
    truth.crush_threshold = 0.3;
    const FrozenState state = knownState(truth);
    const Params base = loadParams(preset);
    const auto keys = innerKeys(defaultKeys(base), base);
    const SolveResult result = solveTuning({{&state, 1}, keys, base, {}}, {});
    Params best = base;
    setCoordinates(keys, result.x, best);
    EXPECT_LT(frozenErrors(state, best).nrmse, 1e-3) << preset;
  }
}

// The field's own truth at its points is what no parameter reaches: the cost has many valleys.
FrozenState roughState(const Params& params, bool lattice, uint64_t seed) {
  FrozenState state = knownState(params, lattice, 200);
  Rng rng(seed, RngStream::test, 40);
  state.power = state.mean = 0;
  for (TunePoint& p : state.points) {
    const Vec3f e = test::roomRadiance(p.query.position, p.query.normal);
    p.truth = std::numbers::pi * luminance(Vec3d(e)) * (0.8 + 0.4 * rng.nextDouble());
    state.power += p.weight * p.truth * p.truth, state.mean += p.weight * p.truth;
  }
  for (TunePoint& p : state.points) p.dark = p.truth < 0.1 * state.mean;
  return state;
}

TEST(SolveTuning, TheOptimumIsWithinAPercentOfAnExhaustiveScan) {
  for (const bool lattice : {true, false})
    for (const char* preset : {"rtxgi", "probelab"}) {
      const Params base = loadParams(preset);
      const FrozenState state = roughState(base, lattice, 1);
      const auto keys = innerKeys({"normal_bias", "view_bias"}, base);
      const TuneObjective objective{{&state, 1}, keys, base, {}};
      const SolveResult result = solveTuning(objective, {});
      const BiasMap map = scanBiases(objective, base, 64, keys[0].high, keys[1].high);
      const double lowest = *std::min_element(map.cost.begin(), map.cost.end());
      EXPECT_LE(result.cost, 1.01 * lowest) << preset << lattice;
      Params best = base;
      setCoordinates(keys, result.x, best);
      EXPECT_NEAR(scoreParams(objective, best).cost, result.cost, 1e-12);
      EXPECT_LE(result.cost, scoreParams(objective, base).cost);
    }
}

TEST(SolveTuning, TheSameSeedGivesTheSameBytesWithOneThreadAndWithTwo) {
  const Params base = loadParams("rtxgi");
  const FrozenState state = roughState(base, true, 2);
  const auto keys = innerKeys({"normal_bias", "view_bias", "chebyshev_power"}, base);
  const auto run = [&](int threads, uint64_t seed) {
    const ThreadLimit limit(threads);
    return solveTuning({{&state, 1}, keys, base, {}},
                       {.starts = 4, .candidates = 16, .seed = seed});
  };
  const SolveResult one = run(1, 1), two = run(2, 1), other = run(2, 2);
  EXPECT_EQ(one.x, two.x);
  EXPECT_EQ(one.best_after, two.best_after);
  EXPECT_EQ(one.singular_values, two.singular_values);
  EXPECT_EQ(one.standard_deviations, two.standard_deviations);
  EXPECT_NE(one.best_after, other.best_after);
}

TEST(SolveTuning, CountsAndPathsFitTogether) {
  const Params base = loadParams("rtxgi");
  const FrozenState state = roughState(base, true, 3);
  const auto keys = innerKeys({"normal_bias", "view_bias"}, base);
  const TuneObjective objective{{&state, 1}, keys, base, {}};
  const SolveResult r = solveTuning(objective, {.starts = 3, .candidates = 8});
  ASSERT_EQ(r.paths.size(), 4u);
  int in_paths = 0;
  for (const SolvePath& path : r.paths) {
    in_paths += path.evaluations;
    EXPECT_FALSE(path.ended.empty());
    for (std::size_t i = 1; i < path.steps.size(); ++i)
      EXPECT_LT(path.steps[i].cost, path.steps[i - 1].cost);
    for (const SolveStep& step : path.steps)
      EXPECT_NEAR(evaluateCost(objective, step.x), step.cost, 1e-12);
  }
  EXPECT_EQ(r.evaluations, in_paths + 8 + 1);  // the coarse set and the base
  EXPECT_EQ(r.best_after.size(), static_cast<std::size_t>(r.evaluations + 2 * r.gradients));
  EXPECT_EQ(r.best_after.back(), r.cost);
}

// At the known optimum residuals are 0, so the deviations are too; a key that does nothing there is
// unbound.
TEST(SolveTuning, AKeyWithoutEffectAtTheOptimumIsReportedAsUnbound) {
  Params base = loadParams("probelab");
  base.crush_threshold = 0.01;
  FrozenState state = roughState(base, true, 4);
  const auto keys = innerKeys({"normal_bias", "trilinear_floor"}, base);
  state.field.modes.trilinear = PL_TRILINEAR_PLAIN;  // the floor is not read
  const SolveResult r = solveTuning({{&state, 1}, keys, base, {}}, {.starts = 2, .candidates = 4});
  EXPECT_TRUE(std::isinf(r.standard_deviations[1]));
  EXPECT_TRUE(std::isfinite(r.standard_deviations[0]));
  EXPECT_GT(r.standard_deviations[0], 0);
  EXPECT_EQ(r.sensitivity[1], 0);
  EXPECT_GT(r.sensitivity[0], 0);
  EXPECT_EQ(r.singular_values[1], 0);
  EXPECT_EQ(r.correlation[0][0], 1);
}

TEST(DirectSearch, CostsFallAndTheBudgetIsKept) {
  const Params base = loadParams("rtxgi");
  const FrozenState state = roughState(base, true, 5);
  const auto keys = innerKeys({"normal_bias", "view_bias"}, base);
  const TuneObjective objective{{&state, 1}, keys, base, {}};
  const std::vector<double> start = toCoordinates(keys, base);
  const auto simplex = nelderMead(objective, start, 300);
  const auto random = randomSearch(objective, 300, 1);
  EXPECT_EQ(simplex.size(), 300u);
  EXPECT_EQ(random.size(), 300u);
  EXPECT_EQ(simplex.front(), evaluateCost(objective, start));
  EXPECT_TRUE(std::is_sorted(simplex.rbegin(), simplex.rend()));
  EXPECT_TRUE(std::is_sorted(random.rbegin(), random.rend()));
  const double best = solveTuning(objective, {}).cost;
  EXPECT_LT(simplex.back(), 1.1 * best);  // a fair opponent
  EXPECT_LT(random.back(), 1.1 * best);
}

TEST(ScanBiases, ValuesLieWhereTheMapSaysTheyDo) {
  const Params base = loadParams("rtxgi");
  const FrozenState state = roughState(base, true, 6);
  const auto keys = innerKeys({"normal_bias"}, base);
  const TuneObjective objective{{&state, 1}, keys, base, {}};
  const BiasMap map = scanBiases(objective, base, 5, 0.4, 0.8);
  ASSERT_EQ(map.cost.size(), 25u);
  Params at = base;
  at.normal_bias = 0.3, at.view_bias = 0.2;
  EXPECT_NEAR(map.cost[1 * 5 + 3], scoreParams(objective, at).cost, 1e-12);
  EXPECT_NEAR(map.nrmse[1 * 5 + 3], frozenErrors(state, at).nrmse, 1e-12);
  EXPECT_NEAR(map.light_leak[1 * 5 + 3], frozenErrors(state, at).light_leak, 1e-12);
}

}  // namespace
}  // namespace probelab
