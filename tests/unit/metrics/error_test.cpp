// SPDX-License-Identifier: GPL-3.0-or-later
// Every receiver metric against cases worked out by hand, and nrmse against simulated noise.
#include "metrics/error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/rng.h"

namespace probelab {
namespace {

// Inputs are fp32, results double: a few 2^-24 relative.
constexpr double kRounding = 1e-6;

struct Data {
  std::vector<Vec3f> estimate, a, b, position;
  std::vector<float> area;
  std::vector<int> region, kind;

  void add(Vec3f e, Vec3f half_a, Vec3f half_b, float weight = 1, int receiver_kind = 0) {
    position.emplace_back(float(estimate.size()), 0.0f, 0.0f);
    estimate.push_back(e), a.push_back(half_a), b.push_back(half_b);
    area.push_back(weight), region.push_back(0), kind.push_back(receiver_kind);
  }
  void addGrey(float e, float half_a, float half_b, float weight = 1, int receiver_kind = 0) {
    add(Vec3f(e), Vec3f(half_a), Vec3f(half_b), weight, receiver_kind);
  }
  ReceiverSamples samples() const { return {estimate, a, b, position, area, region, kind}; }
  ErrorReport report() const { return computeErrors(samples()); }
};

// R = 2, 1, 1, 4, R̄ = 2, one noisy reference.
Data noisyCase() {
  Data d;
  d.addGrey(4, 1, 3);
  d.addGrey(1, 1, 1);
  d.addGrey(0, 1, 1);
  d.addGrey(4, 4, 4);
  return d;
}

TEST(Errors, AreThoseWorkedOutByHand) {
  const ErrorReport report = noisyCase().report();
  const ErrorMetrics& m = report.all;
  EXPECT_NEAR(report.mean_reference, 2.0, kRounding);
  EXPECT_NEAR(*m.nrmse, std::sqrt((3.0 + 0 + 1 + 0) / (3 + 1 + 1 + 16)), kRounding);
  EXPECT_NEAR(*m.bias, (2.0 - 1) / 4 / 2, kRounding);
  EXPECT_NEAR(*m.relmse, (4 / 4.0004 + 1 / 1.0004) / 4, kRounding);
  EXPECT_NEAR(*m.smape, (2 * 2 / 6.002 + 2 * 1 / 1.002) / 4, kRounding);
  EXPECT_NEAR(*m.p95, 2 / 2.02, kRounding);
  EXPECT_NEAR(*m.p99, 2 / 2.02, kRounding);
  EXPECT_NEAR(*m.leak_area, 0.5, kRounding);  // 2 > 1 + 0.1 and 1 > 0.5 + 0.1
  // All four share sigma = sqrt(1 / 4), so the third's 1 - 0 - 2 sigma is not above noise.
  EXPECT_NEAR(*m.shadow_leak, 0.0, kRounding);
  EXPECT_NEAR(*m.light_leak, 0.0, kRounding);
  EXPECT_FALSE(m.dark_leak);
  EXPECT_NEAR(m.max_abs, 4.0, kRounding);
}

TEST(Errors, NoiseFloorIsThatWorkedOutByHand) {
  const ErrorMetrics floor = noisyCase().report().noise_floor;
  EXPECT_NEAR(*floor.nrmse, std::sqrt(1.0 / 21), kRounding);  // (1 - 3)^2 / 4 over 21
  // The others compare A = 1, 1, 1, 4 with B = 3, 1, 1, 4, whose mean is 9 / 4.
  EXPECT_NEAR(*floor.bias, -0.5 / 2.25, kRounding);
  EXPECT_NEAR(*floor.relmse, 4 / (9 + 0.0225 * 0.0225) / 4, kRounding);
  EXPECT_NEAR(*floor.p95, 2 / 3.0225, kRounding);
  EXPECT_NEAR(*floor.leak_area, 0.25, kRounding);  // 2 > 1.5 + 0.1125
  EXPECT_NEAR(*floor.shadow_leak, (2 - 1.0) / 4 / 2.25, kRounding);
  EXPECT_NEAR(floor.max_abs, 4.0, kRounding);
}

TEST(Errors, LeaksAreThoseWorkedOutByHand) {
  Data d;  // R̄ = 20.1 / 4
  d.addGrey(1.0f, 0, 0);
  d.addGrey(0.2f, 0.1f, 0.1f);
  d.addGrey(4, 10, 10);
  d.addGrey(12, 10, 10);
  const ErrorMetrics m = d.report().all;
  const double mean = 20.1 / 4;
  EXPECT_NEAR(*m.light_leak, (1 + 0.1) / 4 / mean, kRounding);
  EXPECT_NEAR(*m.shadow_leak, 6.0 / 4 / mean, kRounding);
  EXPECT_NEAR(*m.dark_leak, 1 / mean, kRounding);  // 0.1 is above 0.01 R̄
  EXPECT_NEAR(*m.leak_area, 0.5, kRounding);
}

TEST(Errors, WeighReceiversByArea) {
  Data d;  // weights 1/4 and 3/4
  d.addGrey(0, 2, 2, 5);
  d.addGrey(3, 2, 2, 15);
  const ErrorMetrics m = d.report().all;
  EXPECT_NEAR(*m.nrmse, std::sqrt((0.25 * 4 + 0.75 * 1) / 4), kRounding);
  EXPECT_NEAR(*m.bias, (0.25 * -2 + 0.75 * 1) / 2, kRounding);
  EXPECT_FALSE(m.dark_leak);
}

TEST(Errors, ReportChannelsApart) {
  Data d;
  d.add({1, 4, 0}, {2, 2, 0}, {2, 2, 0});
  const ErrorMetrics m = d.report().all;
  EXPECT_NEAR(*m.nrmse_rgb[0], 0.5, kRounding);
  EXPECT_NEAR(*m.nrmse_rgb[1], 1.0, kRounding);
  EXPECT_NEAR(*m.bias_rgb[0], -0.5, kRounding);
  EXPECT_NEAR(*m.bias_rgb[1], 1.0, kRounding);
  EXPECT_FALSE(m.nrmse_rgb[2] || m.bias_rgb[2]);  // a black channel has no relative error
  const double luminance_error = -0.2126 + 2 * 0.7152, reference = 2 * (0.2126 + 0.7152);
  EXPECT_NEAR(*m.bias, luminance_error / reference, kRounding);
}

TEST(Errors, RepeatTheTablePerKind) {
  Data d;
  d.addGrey(1, 2, 2, 7, kSurfaceReceiver);
  d.addGrey(6, 4, 4, 3, kVolumeReceiver);
  const ErrorReport report = d.report();
  EXPECT_NEAR(*report.surface->nrmse, 0.5, kRounding);
  EXPECT_NEAR(*report.volume->bias, 0.5, kRounding);
  EXPECT_NEAR(*report.surface_noise_floor->nrmse, 0.0, kRounding);
  d.kind = {0, 0};
  EXPECT_FALSE(d.report().volume);
  EXPECT_FALSE(d.report().volume_noise_floor);
}

TEST(Errors, AreNullInAnUnlitScene) {
  Data d;
  d.addGrey(0.25f, 0, 0);
  d.addGrey(-0.5f, 0, 0);
  const ErrorReport report = d.report();
  for (const auto& [name, value] : namedMetrics(report.all))
    EXPECT_EQ(value.has_value(), name == "max_abs") << name;
  EXPECT_NEAR(report.all.max_abs, 0.5, kRounding);
  EXPECT_NEAR(report.noise_floor.max_abs, 0.0, kRounding);
}

TEST(Errors, OfAnExactEstimateAreZero) {
  Data d;
  for (int i = 0; i < 100; ++i) d.addGrey(float(i), float(i), float(i));
  for (const auto& [name, value] : namedMetrics(d.report().all)) {
    if (name == "max_abs")
      EXPECT_EQ(*value, luminance(Vec3d(99.0)));
    else
      EXPECT_EQ(*value, 0.0) << name;
  }
}

TEST(Errors, DoNotDependOnTheUnitOfLight) {
  Data d = noisyCase(), dim = d;
  for (auto* values : {&dim.estimate, &dim.a, &dim.b})
    for (Vec3f& v : *values) v *= 0x1p-20f;  // exact, so the results are equal bit for bit
  const auto x = namedMetrics(d.report().all), y = namedMetrics(dim.report().all);
  for (size_t i = 0; i + 1 < x.size(); ++i) EXPECT_EQ(x[i].second, y[i].second) << x[i].first;
}

// Estimate 1.1, truth 1, halves with uniform noise of +-0.5 (variance 1/12).
Data simulation(size_t count) {
  Data d;
  Rng rng(1, RngStream::test);
  for (size_t i = 0; i < count; ++i)
    d.addGrey(1.1f, 0.5f + rng.nextFloat(), 0.5f + rng.nextFloat());
  return d;
}

TEST(Errors, NrmseHoldsNoReferenceNoise) {
  const size_t n = 100000;
  const ErrorReport report = simulation(n).report();
  // (E-A)(E-B) has variance 2 * 0.01 / 12 + 1 / 144 = 0.0086, so the mean of n has a standard
  // error of 2.9e-4 around 0.01: 1.5 % of nrmse = 0.1. Five of them; naively it would be 0.23.
  EXPECT_NEAR(*report.all.nrmse, 0.1, 5 * 0.0015);
  // (A-B)^2 / 4 has mean 1/24 and standard deviation below 0.05: 0.2 % of the root, five times.
  EXPECT_NEAR(*report.noise_floor.nrmse, std::sqrt(1.0 / 24), 5 * 0.002 * 0.204);
}

TEST(Errors, NameWhatIsNotFinite) {
  for (int array = 0; array < 4; ++array) {
    Data d = noisyCase();
    auto& values = array == 0 ? d.estimate : array == 1 ? d.a : array == 2 ? d.b : d.position;
    values[2].z = array % 2 ? std::numeric_limits<float>::infinity() : NAN;
    try {
      d.report();
      FAIL();
    } catch (const NumericalError& e) {
      EXPECT_NE(std::string(e.what()).find("[2]"), std::string::npos) << e.what();
    }
  }
  Data d = noisyCase();
  d.area[1] = NAN;
  EXPECT_THROW(d.report(), NumericalError);
}

TEST(Errors, RefuseUnusableWeights) {
  EXPECT_THROW(Data().report(), InputError);
  Data d = noisyCase();
  d.area = {0, 0, 0, 0};
  EXPECT_THROW(d.report(), InputError);
  d.area = {1, 1, -1, 1};
  EXPECT_THROW(d.report(), InputError);
}

TEST(PooledVariance, IsTheMeanOverTheSixteenNearest) {
  Data d;  // own variance of receiver i: i^2
  for (int i = 0; i < 20; ++i) d.addGrey(1, float(2 * i), 0);
  const std::vector<double> v = pooledVariance(d.samples());
  EXPECT_NEAR(v[0], 15 * 16 * 31 / 6.0 / 16, 1e-4);                       // 0 to 15
  EXPECT_NEAR(v[19], (19 * 20 * 39 / 6.0 - 3 * 4 * 7 / 6.0) / 16, 1e-4);  // 4 to 19
  // 10 has 2 and 18 at equal distance; the smaller index counts: 2 to 17.
  EXPECT_NEAR(v[10], (17 * 18 * 35 / 6.0 - 1) / 16, 1e-4);
}

TEST(PooledVariance, StaysWithinRegionAndKind) {
  Data d;
  for (int i = 0; i < 6; ++i) d.addGrey(1, float(2 * i), 0);
  d.region = {0, 0, 1, 1, 1, 1};
  d.kind = {0, 0, 0, 0, 1, 1};
  const std::vector<double> v = pooledVariance(d.samples());
  const std::vector<double> expected = {0.5, 0.5, 6.5, 6.5, 20.5, 20.5};
  for (size_t i = 0; i < 6; ++i) EXPECT_NEAR(v[i], expected[i], 1e-5);
}

TEST(PooledVariance, EqualsBruteForceOnScatteredAndCoincidentPoints) {
  Data d = simulation(500);
  Rng rng(2, RngStream::test);
  for (Vec3f& p : d.position)
    p = {std::floor(4 * rng.nextFloat()), rng.nextFloat(), std::floor(2 * rng.nextFloat())};
  for (size_t i = 0; i < 40; ++i) d.position[i] = Vec3f(1);
  const std::vector<double> v = pooledVariance(d.samples());
  for (size_t i = 0; i < 500; ++i) {
    std::vector<std::pair<double, size_t>> all;
    for (size_t j = 0; j < 500; ++j) {
      const Vec3d offset = Vec3d(d.position[i]) - Vec3d(d.position[j]);
      all.emplace_back(dot(offset, offset), j);
    }
    std::sort(all.begin(), all.end());
    double sum = 0;
    for (size_t k = 0; k < 16; ++k) {
      const size_t j = all[k].second;
      sum += std::pow(luminance(Vec3d(d.a[j])) - luminance(Vec3d(d.b[j])), 2) / 4;
    }
    EXPECT_NEAR(v[i], sum / 16, 1e-12) << i;
  }
}

TEST(WeightedPercentile, InvertsTheWeightedDistribution) {
  const std::vector<double> values = {30, 10, 20};
  EXPECT_EQ(weightedPercentile(values, std::vector<double>{1, 1, 1}, 0.5), 20);
  EXPECT_EQ(weightedPercentile(values, std::vector<double>{0.2, 0.5, 0.3}, 0.5), 10);
  EXPECT_EQ(weightedPercentile(values, std::vector<double>{0.2, 0.5, 0.3}, 0.51), 20);
  EXPECT_EQ(weightedPercentile(values, std::vector<double>{0, 1, 1}, 1.0), 20);
  std::vector<double> twenty(20), weights(20, 0.05);
  for (int i = 0; i < 20; ++i) twenty[i] = i;
  EXPECT_EQ(weightedPercentile(twenty, weights, 0.95), 18);
}

TEST(IsResolved, NeedsFourTimesTheFloor) {
  EXPECT_TRUE(isResolved(0.41, 0.1));
  EXPECT_FALSE(isResolved(0.4, 0.1));
  EXPECT_TRUE(isResolved(-0.41, 0.1));
  EXPECT_FALSE(isResolved(std::nullopt, 0.1));
  EXPECT_FALSE(isResolved(0.1, std::nullopt));
}

}  // namespace
}  // namespace probelab
