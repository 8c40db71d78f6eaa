// SPDX-License-Identifier: GPL-3.0-or-later
// The query of scattered probes in C++, on texels set by hand.
#include <gtest/gtest.h>

#include "scattered_helpers.h"

namespace probelab {
namespace {

using test::fillTexels;
using test::latticeAsScattered;
using test::randomQueries;
using test::randomScattered;

const Box3f kRoom{Vec3f(-1, 0, -2), Vec3f(3, 2.5f, 1)};
const char* const kPresets[] = {"classic", "gdc2019", "majercik2021", "rtxgi", "probelab"};

ProbeLayout scattered(uint64_t seed = 1) {
  return randomScattered(kRoom, 60, Vec3i(9, 7, 8), kRoom, seed);
}

FieldSnapshot snapshotOf(const ProbeLayout& layout, const Params& params) {
  return layoutSnapshot(layout, initialStates(layout), params);
}

Vec3d answer(const FieldSnapshot& snapshot, const QueryPoint& point) {
  return querySnapshot<double>(snapshot, snapshot.params, point).irradiance;
}

// Positions and spacings are exact in fp32, so nothing but the order of the sums differs.
TEST(ScatteredQuery, PointsOfALatticeAsCornersGiveTheLatticesQuery) {
  const Lattice lattice =
      makeLattice({Vec3f(-0.75f, 0.25f, -1.75f), Vec3f(2.25f, 2.25f, 0.5f)}, Vec3i(5, 3, 4));
  const ProbeLayout grid = latticeLayout(lattice, kRoom, std::vector<uint8_t>(60, 1));
  const ProbeLayout corners = latticeAsScattered(grid);
  for (const char* preset : kPresets) {
    Params params = loadParams(preset);
    params.trilinear_floor = 0;
    FieldSnapshot expected = snapshotOf(grid, params), got = snapshotOf(corners, params);
    fillTexels(expected, 3), fillTexels(got, 3);
    for (const QueryPoint& point :
         randomQueries({kRoom.min - Vec3f(0.5f), kRoom.max + Vec3f(0.5f)}, 3000, 4))
      ASSERT_LT(length(answer(got, point) - answer(expected, point)), 1e-10) << preset;
  }
}

TEST(ScatteredQuery, EqualsTheFormulasWithEveryProbesOwnLengths) {
  const ProbeLayout layout = scattered();
  Params params = loadParams("rtxgi");
  params.normal_bias = 0.3, params.view_bias = 0.2;
  FieldSnapshot snapshot = snapshotOf(layout, params);
  fillTexels(snapshot, 5);
  double uniform_differs = 0;
  FieldSnapshot uniform = snapshot;
  for (float& bias : uniform.bias_lengths) bias = layout.bias_length_m;
  for (const QueryPoint& point : randomQueries(kRoom, 3000, 6)) {
    const Vec3d expected = test::rtxgiByHand(layout, snapshot, params, point);
    ASSERT_LT(length(answer(snapshot, point) - expected), 1e-9);
    uniform_differs = std::max(uniform_differs, length(answer(uniform, point) - expected));
  }
  EXPECT_GT(uniform_differs, 0.01);
}

// Every probe alike: the weights must cancel, and their sum is 0 nowhere.
TEST(ScatteredQuery, AConstantFieldIsReproduced) {
  const ProbeLayout layout = scattered();
  for (const char* preset : kPresets) {
    Params params = loadParams(preset);
    params.encoding_gamma = 1;  // a power would raise the rounding of the readings too
    FieldSnapshot snapshot = snapshotOf(layout, params);
    fillTexels(snapshot, 7);
    for (Vec3f& texel : snapshot.irradiance) texel = Vec3f(0.3f);
    const double expected = std::numbers::pi * static_cast<double>(0.3f);
    for (const QueryPoint& point : randomQueries(kRoom, 3000, 8)) {
      const auto exact = querySnapshot<double>(snapshot, snapshot.params, point);
      ASSERT_EQ(exact.answer, PL_ANSWER_WEIGHED) << preset;
      ASSERT_NEAR(exact.irradiance.x / expected, 1, 1e-12) << preset;
      const auto single =
          querySnapshot<float>(snapshot, convertQueryParams<float>(snapshot.params), point);
      ASSERT_NEAR(static_cast<double>(single.irradiance.y) / expected, 1, 1e-6) << preset;
    }
  }
}

// One probe white, the others black, averaged linearly: the answer is its weight.
TEST(ScatteredQuery, WeightsAreNotNegativeAndSumToOne) {
  const ProbeLayout layout = randomScattered(kRoom, 12, Vec3i(4, 3, 4), kRoom, 9, 4);
  Params params = loadParams("gdc2019");
  params.encoding_gamma = 1;
  params.average = PL_AVERAGE_LINEAR;
  FieldSnapshot snapshot = snapshotOf(layout, params);
  fillTexels(snapshot, 10);
  const std::vector<QueryPoint> points = randomQueries(kRoom, 500, 11);
  std::vector<double> sums(points.size(), 0.0);
  const std::size_t per_probe = snapshot.irradiance.size() / layout.positions.size();
  for (std::size_t p = 0; p < layout.positions.size(); ++p) {
    for (std::size_t i = 0; i < snapshot.irradiance.size(); ++i)
      snapshot.irradiance[i] = Vec3f(i / per_probe == p ? 1.0f : 0.0f);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double weight = answer(snapshot, points[i]).x / std::numbers::pi;
      ASSERT_GE(weight, 0);
      sums[i] += weight;
    }
  }
  for (const double sum : sums) EXPECT_NEAR(sum, 1, 1e-12);
}

// A jump stays however near its sides: every step with a change of 1e-4 of the range is halved,
// each time the half with the larger change, until nothing is left that a slope explains.
TEST(ScatteredQuery, TheFieldHasNoJumpsAlongRandomSegments) {
  const ProbeLayout layout = scattered(12);
  for (const char* preset : kPresets) {
    Params params = loadParams(preset);
    params.border = 0;  // texels set by hand have no border that fits
    FieldSnapshot snapshot = snapshotOf(layout, params);
    fillTexels(snapshot, 13);
    Rng rng(14, RngStream::test);
    int halved = 0;
    for (int segment = 0; segment < 12; ++segment) {
      const Vec3f from = test::randomIn(rng, kRoom), to = test::randomIn(rng, kRoom);
      const Vec3d normal(test::randomUnit(rng)), view(test::randomUnit(rng));
      const auto at = [&](double t) {
        const Vec3d p = Vec3d(from) + (Vec3d(to) - Vec3d(from)) * t;
        return queryScattered(snapshot, snapshot.params, snapshot.modes, snapshot.lattice, p,
                              normal, view)
            .irradiance.x;
      };
      for (int i = 0; i < 300; ++i) {
        double a = i / 300.0, b = (i + 1) / 300.0;
        const double limit = 1e-4 * std::numbers::pi;
        for (int k = 0; k < 40 && std::abs(at(b) - at(a)) > limit; ++k, ++halved) {
          const double m = 0.5 * (a + b);
          (std::abs(at(m) - at(a)) > std::abs(at(b) - at(m)) ? b : a) = m;
        }
        ASSERT_LE(std::abs(at(b) - at(a)), limit)
            << preset << " segment " << segment << " at " << a;
      }
    }
    EXPECT_GT(halved, 1000) << preset;
  }
}

TEST(ScatteredQuery, InactiveProbesCountNowhere) {
  const ProbeLayout layout = scattered(15);
  Params params = loadParams("classic");
  params.fallback = PL_FALLBACK_NEAREST;
  ProbeStates states = initialStates(layout);
  for (std::size_t p = 0; p < states.active.size(); ++p) states.active[p] = p % 3 == 0 ? 1 : 0;
  FieldSnapshot snapshot = layoutSnapshot(layout, states, params);
  fillTexels(snapshot, 16);
  // White where active: any other texel would darken the answer.
  const std::size_t per_probe = snapshot.irradiance.size() / layout.positions.size();
  for (std::size_t i = 0; i < snapshot.irradiance.size(); ++i)
    snapshot.irradiance[i] = Vec3f(states.active[i / per_probe] != 0 ? 1.0f : 0.5f);
  int nearest = 0;
  for (const QueryPoint& point : randomQueries(kRoom, 2000, 17)) {
    const auto result = querySnapshot<double>(snapshot, snapshot.params, point);
    ASSERT_NEAR(result.irradiance.x, std::numbers::pi, 1e-6);
    nearest += result.answer == PL_ANSWER_NEAREST ? 1 : 0;
  }
  EXPECT_GT(nearest, 0);
  EXPECT_LT(nearest, 500);
}

TEST(ScatteredQuery, FadesOutOverTheMeanBiasLengthOutsideTheBounds) {
  const ProbeLayout layout = scattered(18);
  FieldSnapshot snapshot = snapshotOf(layout, loadParams("classic"));
  fillTexels(snapshot, 19);
  for (Vec3f& texel : snapshot.irradiance) texel = Vec3f(1);
  for (const double share : {0.0, 0.25, 0.75, 1.0, 2.0}) {
    const auto offset = static_cast<float>(share) * layout.bias_length_m;
    const QueryPoint point{{kRoom.max.x + offset, 1, 0}, {1, 0, 0}, {-1, 0, 0}};
    EXPECT_NEAR(answer(snapshot, point).x, std::numbers::pi * std::max(0.0, 1 - share), 1e-5);
  }
}

// A number with its derivative by one variable; only what the shared headers use.
struct Dual {
  double a = 0, d = 0;
  Dual() = default;
  Dual(double value, double derivative = 0) : a(value), d(derivative) {}
};
Dual operator+(const Dual& x, const Dual& y) { return {x.a + y.a, x.d + y.d}; }
Dual operator-(const Dual& x, const Dual& y) { return {x.a - y.a, x.d - y.d}; }
Dual operator-(const Dual& x) { return {-x.a, -x.d}; }
Dual operator*(const Dual& x, const Dual& y) { return {x.a * y.a, x.a * y.d + x.d * y.a}; }
Dual operator/(const Dual& x, const Dual& y) { return {x.a / y.a, (x.d - x.a / y.a * y.d) / y.a}; }
bool operator<(const Dual& x, const Dual& y) { return x.a < y.a; }
bool operator>(const Dual& x, const Dual& y) { return x.a > y.a; }
bool operator<=(const Dual& x, const Dual& y) { return x.a <= y.a; }
bool operator>=(const Dual& x, const Dual& y) { return x.a >= y.a; }
Dual abs(const Dual& x) { return x.a < 0 ? -x : x; }
Dual sqrt(const Dual& x) { return {std::sqrt(x.a), x.d / (2 * std::sqrt(x.a))}; }
Dual pow(const Dual& x, const Dual& e) {
  const double p = std::pow(x.a, e.a);
  return {p, p * (e.d * std::log(x.a) + e.a * x.d / x.a)};
}

// Derivatives by every parameter of the query, against central differences.
TEST(ScatteredQuery, DerivativesFlowThroughIt) {
  const ProbeLayout layout = scattered(20);
  Params params = loadParams("rtxgi");
  params.parallax = 0.5;
  FieldSnapshot snapshot = snapshotOf(layout, params);
  fillTexels(snapshot, 21);
  double QueryParams<double>::*const plain[] = {
      &QueryParams<double>::normal_bias, &QueryParams<double>::view_bias,
      &QueryParams<double>::facing_offset, &QueryParams<double>::chebyshev_power,
      &QueryParams<double>::crush_threshold, &QueryParams<double>::parallax};
  Dual QueryParams<Dual>::*const dual[] = {
      &QueryParams<Dual>::normal_bias, &QueryParams<Dual>::view_bias,
      &QueryParams<Dual>::facing_offset, &QueryParams<Dual>::chebyshev_power,
      &QueryParams<Dual>::crush_threshold, &QueryParams<Dual>::parallax};
  const std::vector<QueryPoint> points = randomQueries(kRoom, 50, 22);
  for (std::size_t i = 0; i < std::size(plain); ++i) {
    int agree = 0;
    double largest = 0;
    for (const QueryPoint& point : points) {
      QueryParams<Dual> with = convertQueryParams<Dual>(snapshot.params);
      (with.*dual[i]).d = 1;
      const double derivative = querySnapshot<Dual>(snapshot, with, point).irradiance.x.d;
      const auto shifted = [&](double step) {
        QueryParams<double> p = snapshot.params;
        p.*plain[i] += step;
        return querySnapshot<double>(snapshot, p, point).irradiance.x;
      };
      const double difference = (shifted(1e-6) - shifted(-1e-6)) / 2e-6;
      agree += std::abs(derivative - difference) < 1e-5 * (1 + std::abs(difference)) ? 1 : 0;
      largest = std::max(largest, std::abs(difference));
    }
    EXPECT_GE(agree, 48) << i;  // a texel's border may lie within the step
    EXPECT_GT(largest, 1e-4) << i;
  }
}

}  // namespace
}  // namespace probelab
