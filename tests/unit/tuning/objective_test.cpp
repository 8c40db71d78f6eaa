// SPDX-License-Identifier: GPL-3.0-or-later
// The cost and its derivatives: against differences, by hand, and against the metrics.
#include "tuning/objective.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/parallel.h"
#include "metrics/error.h"
#include "tuning_helpers.h"

namespace probelab {
namespace {

using test::innerKeys;
using test::room;
using test::roomPoints;
using test::RoomScene;
using test::roomSnapshot;
using test::stateOf;

struct Evaluated {
  std::vector<double> residuals, jacobian;
};
Evaluated evaluate(const TuneObjective& objective, const std::vector<double>& x) {
  Evaluated e;
  e.residuals.resize(residualCount(objective));
  e.jacobian.resize(e.residuals.size() * objective.keys.size());
  evaluateResiduals(objective, x, e.residuals, e.jacobian);
  return e;
}
std::vector<double> valuesAt(const TuneObjective& objective, std::vector<double> x, std::size_t key,
                             double step) {
  x[key] += step;
  std::vector<double> residuals(residualCount(objective));
  evaluateResiduals(objective, x, residuals);
  return residuals;
}

// Every derivative is the central difference, or, where a kink lies within a step of the point, the
// difference to one side.
void expectDerivatives(FrozenState& state, const Params& base, bool lattice) {
  std::vector<std::string> names = {"normal_bias",     "view_bias",        "facing_offset",
                                    "chebyshev_power", "visibility_floor", "variance_bias",
                                    "crush_threshold", "parallax"};
  state.field.modes.parallax = 1;  // whatever its value
  if (lattice) names.push_back("trilinear_floor");
  const auto keys = innerKeys(names, base);
  const TuneObjective objective{{&state, 1}, keys, base, {.leak = 1, .shadow = 0.7, .robust = 0.5}};
  const std::vector<double> x = {0.31, 0.22, 0.4, 0.47, 0.35, 0.3, 0.52, 0.37, 0.28};
  const std::vector<double> at(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(names.size()));
  const Evaluated e = evaluate(objective, at);
  constexpr double kStep = 1e-6;  // its rounding: 1e-16 / 1e-6; its curvature: 1e-6 f''
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const auto up = valuesAt(objective, at, k, kStep), down = valuesAt(objective, at, k, -kStep);
    double scale = 0;
    for (std::size_t r = 0; r < up.size(); ++r)
      scale = std::max(scale, std::abs(e.jacobian[r * keys.size() + k]));
    ASSERT_GT(scale, 1e-6) << keys[k].name;
    int kinks = 0;
    for (std::size_t r = 0; r < up.size(); ++r) {
      const double got = e.jacobian[r * keys.size() + k];
      const auto is_near = [&](double difference) {
        return std::abs(got - difference) < 1e-4 * scale;
      };
      if (is_near((up[r] - down[r]) / (2 * kStep))) continue;
      ++kinks;
      EXPECT_TRUE(is_near((up[r] - e.residuals[r]) / kStep) ||
                  is_near((e.residuals[r] - down[r]) / kStep))
          << keys[k].name << " residual " << r;
    }
    EXPECT_LE(kinks, 2) << keys[k].name;
  }
}

class Derivatives : public testing::TestWithParam<const char*> {};

TEST_P(Derivatives, AgreeWithDifferencesOnALattice) {
  Params params = loadParams(GetParam());
  FrozenState state = stateOf(roomSnapshot(room(), test::roomLattice(room()), params),
                              roomPoints(room(), 400, 1), params);
  ASSERT_TRUE(std::any_of(state.points.begin(), state.points.end(),
                          [](const TunePoint& p) { return p.dark; }));
  expectDerivatives(state, params, true);
}

TEST_P(Derivatives, AgreeWithDifferencesOnScatteredProbes) {
  Params params = loadParams(GetParam());
  FrozenState state = stateOf(roomSnapshot(room(), test::roomScattered(room()), params),
                              roomPoints(room(), 400, 2), params);
  expectDerivatives(state, params, false);
}

INSTANTIATE_TEST_SUITE_P(Presets, Derivatives,
                         testing::Values("rtxgi", "gdc2019", "probelab", "majercik2021"));

// Weights of exactly 0, roots of 0, powers of 0: finite, or evaluateResiduals throws.
TEST(Objective, ZerosHaveFiniteDerivatives) {
  for (const char* preset : {"gdc2019", "probelab", "rtxgi"}) {
    Params params = loadParams(preset);
    params.visibility_floor = 0, params.variance_bias = 0, params.facing_offset = 0;
    FieldSnapshot field = roomSnapshot(room(), test::roomLattice(room()), params);
    // All texels of every second probe are black, of every third one at distance 0: it is occluded
    // everywhere, with weight 0.
    const std::size_t probes = field.positions.size();
    for (std::size_t i = 0; i < field.irradiance.size(); ++i)
      if (i / (field.irradiance.size() / probes) % 2 == 0) field.irradiance[i] = Vec3f(0);
    for (std::size_t i = 0; i < field.moments.size(); ++i)
      if (i / (field.moments.size() / probes) % 3 == 0) field.moments[i] = Vec2f(0);
    const FrozenState state = stateOf(std::move(field), roomPoints(room(), 500, 3), params);
    const auto keys = innerKeys({"normal_bias", "view_bias", "facing_offset", "chebyshev_power",
                                 "visibility_floor", "variance_bias", "crush_threshold"},
                                params);
    const TuneObjective objective{{&state, 1}, keys, params, {}};
    EXPECT_NO_THROW(evaluate(objective, toCoordinates(keys, params))) << preset;
  }
}

// One probe of constant irradiance: the estimate is pi c whatever the parameters.
FrozenState constantState(float c) {
  Params params = loadParams("probelab");
  params.average = PL_AVERAGE_LINEAR;
  const ProbeLayout layout = latticeLayout(makeLattice({Vec3f(1), Vec3f(3)}, Vec3i(2)),
                                           {Vec3f(0), Vec3f(4)}, std::vector<uint8_t>(8, 1));
  FrozenState state;
  state.field = roomSnapshot(room(), layout, params);
  for (Vec3f& texel : state.field.irradiance) texel = Vec3f(c);
  return state;
}

TEST(Objective, TheCostIsWhatItsDefinitionGivesByHand) {
  FrozenState state = constantState(0.5f);
  const double e = std::numbers::pi * 0.5;
  const QueryPoint at{Vec3f(2), Vec3f(0, 1, 0), Vec3f(0, -1, 0)};
  state.points = {{at, e + 0.3, 0.5, 0.05, false},
                  {at, e - 0.4, 0.25, 0.05, true},
                  {at, e - 0.01, 0.25, 0.05, true}};  // dark ones last
  state.power = 4, state.mean = 2, state.weight = 3;
  const FrozenState other = [&] {
    FrozenState s = state;
    s.weight = 1, s.points = {{at, e - 1, 1, 0, false}};
    return s;
  }();
  const std::vector<FrozenState> states = {state, other};
  const Params base = loadParams("probelab");
  const auto keys = innerKeys({"normal_bias"}, base);
  const double squares = (0.5 * 0.09 + 0.25 * 0.16 + 0.25 * 1e-4) / 4;
  const double u = (0.4 - 0.1) / 2, leak = 0.25 * u * u / (u + 1e-3);
  const std::vector<double> x = {0.2};
  TuneObjective objective{states, keys, base, {.leak = 0, .robust = 0}};
  EXPECT_EQ(residualCount(objective), 4u);
  EXPECT_NEAR(evaluateCost(objective, x), 0.75 * squares + 0.25 / 4, 1e-12);
  objective.settings.leak = 2;
  EXPECT_EQ(residualCount(objective), 6u);
  EXPECT_NEAR(evaluateCost(objective, x), 0.75 * (squares + 2 * leak) + 0.25 / 4, 1e-12);
  // The point that is not dark is too dark by 0.3; the other state's is too bright.
  const double v = (0.3 - 0.1) / 2, shadow = 0.5 * v * v / (v + 1e-3);
  objective.settings.shadow = 3;
  EXPECT_EQ(residualCount(objective), 8u);
  EXPECT_NEAR(evaluateCost(objective, x), 0.75 * (squares + 2 * leak + 3 * shadow) + 0.25 / 4,
              1e-12);
  // Linear beyond 0.1 x 2: rho = 2 x 0.2 |e| - 0.04.
  objective.settings = {.leak = 0, .robust = 0.1};
  const double robust = (0.5 * 0.08 + 0.25 * 0.12 + 0.25 * 1e-4) / 4;
  EXPECT_NEAR(evaluateCost(objective, x), 0.75 * robust + 0.25 * 0.36 / 4, 1e-12);
}

TEST(Objective, CostAndErrorsAgreeWithTheMetrics) {
  const Params params = loadParams("rtxgi");
  const std::vector<QueryPoint> points = roomPoints(room(), 300, 4);
  Receivers receivers;
  receivers.samples = 1;
  Rng rng(1, RngStream::test, 32);
  for (const QueryPoint& p : points) {
    Receiver r{p.position, p.normal, p.view, 0.5 + rng.nextDouble()};
    r.region = p.position.x < 2 ? 0 : 1, r.split = Split::train;
    const Vec3f e = test::roomRadiance(p.position, p.normal) * 3.0f;
    r.a = e * (0.9f + 0.2f * rng.nextFloat()), r.b = e * (0.9f + 0.2f * rng.nextFloat());
    receivers.points.push_back(r);
  }
  const FrozenState state = freezeState(roomSnapshot(room(), test::roomLattice(room()), params),
                                        receivers, Split::train, {}, room().embree);
  std::vector<Vec3f> estimate, a, b, position;
  std::vector<float> area;
  std::vector<int> region, kind(points.size(), kSurfaceReceiver);
  for (const Receiver& r : receivers.points) {
    estimate.push_back(Vec3f(
        querySnapshot<double>(state.field, queryParams(params), {r.position, r.normal, r.view})
            .irradiance));
    a.push_back(r.a), b.push_back(r.b), position.push_back(r.position);
    area.push_back(static_cast<float>(r.area)), region.push_back(r.region);
  }
  const ErrorReport report = computeErrors({.estimate = estimate,
                                            .a = a,
                                            .b = b,
                                            .position = position,
                                            .area = area,
                                            .region = region,
                                            .kind = kind});
  const FrozenErrors errors = frozenErrors(state, params);
  // Estimates and areas were rounded to fp32.
  EXPECT_NEAR(errors.nrmse, *report.all.nrmse, 1e-6);
  EXPECT_NEAR(errors.light_leak, *report.all.light_leak, 1e-6);
  EXPECT_NEAR(errors.shadow_leak, *report.all.shadow_leak, 1e-6);
  EXPECT_GT(errors.light_leak, 1e-4);
  EXPECT_GT(errors.shadow_leak, 1e-3);
  const auto keys = innerKeys({"normal_bias"}, params);
  const TuneObjective objective{{&state, 1}, keys, params, {.leak = 0}};
  const double floor = *report.noise_floor.nrmse;
  EXPECT_NEAR(evaluateCost(objective, toCoordinates(keys, params)),
              *report.all.nrmse * *report.all.nrmse + floor * floor, 1e-6);
  const ParamsScore score = scoreParams(objective, params);
  EXPECT_NEAR(score.cost, evaluateCost(objective, toCoordinates(keys, params)), 1e-12);
  EXPECT_EQ(score.errors[0].nrmse, errors.nrmse);
}

TEST(Objective, TheNumberOfThreadsChangesNoBit) {
  const Params params = loadParams("rtxgi");
  const FrozenState state = stateOf(roomSnapshot(room(), test::roomLattice(room()), params),
                                    roomPoints(room(), 300, 5), params);
  const auto keys = innerKeys({"normal_bias", "chebyshev_power"}, params);
  const TuneObjective objective{{&state, 1}, keys, params, {}};
  const auto run = [&](int threads) {
    const ThreadLimit limit(threads);
    return evaluate(objective, {0.4, 0.6});
  };
  const Evaluated one = run(1), two = run(2);
  EXPECT_EQ(one.residuals, two.residuals);
  EXPECT_EQ(one.jacobian, two.jacobian);
}

}  // namespace
}  // namespace probelab
