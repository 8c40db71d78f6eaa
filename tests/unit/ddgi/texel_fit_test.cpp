// SPDX-License-Identifier: GPL-3.0-or-later
// Fitted texel values: what the bilinear reading of an octahedral map makes of smooth functions.
#include "ddgi/texel_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "base/rng.h"
#include "random_unit.h"
#include "shared/octahedral.h"

namespace probelab {
namespace {

using test::randomUnitDouble;

using Function = std::function<double(const Vec3d&)>;

Eigen::VectorXd exactTexels(int n, const Function& f) {
  Eigen::VectorXd values(n * n);
  for (int t = 0; t < n * n; ++t) values[t] = f(texelDirection<double>(t % n, t / n, n));
  return values;
}

double readBilinear(const Eigen::VectorXd& values, int n, const Vec3d& d) {
  const OctTaps<double> t = octTaps(d, n, 0);
  const double top = values[t.texel_00] * (1 - t.fraction_x) + values[t.texel_10] * t.fraction_x;
  const double bottom = values[t.texel_01] * (1 - t.fraction_x) + values[t.texel_11] * t.fraction_x;
  return top * (1 - t.fraction_y) + bottom * t.fraction_y;
}

// Root mean square over the sphere of reading minus function.
double rmsError(const Eigen::VectorXd& values, int n, const Function& f) {
  Rng rng(9, RngStream::test);
  constexpr int kSamples = 20000;  // the rms of a bounded error is then known to below 1 %
  double sum = 0;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3d d = randomUnitDouble(rng);
    const double error = readBilinear(values, n, d) - f(d);
    sum += error * error;
  }
  return std::sqrt(sum / kSamples);
}

// Irradiance / pi of the sky a (1 + b.d): 1 + 2/3 b.n for a = 1, |b| = 1.
Function linearSky(Rng& rng) {
  const Vec3d b = randomUnitDouble(rng);
  return [b](const Vec3d& d) { return 1 + 2.0 / 3.0 * dot(b, d); };
}

// A harmonic of degree 2 without mean: d A d with a symmetric traceless A.
Function degreeTwo(Rng& rng) {
  const Vec3d u = randomUnitDouble(rng), v = randomUnitDouble(rng);
  const double trace = dot(u, v) / 3;
  return [u, v, trace](const Vec3d& d) { return dot(u, d) * dot(v, d) - trace; };
}

TEST(TexelFit, RowsSumToOne) {
  for (const int n : {1, 2, 4, 6, 8, 12, 14}) {
    const Eigen::MatrixXd fit = bilinearFit(n);
    ASSERT_EQ(fit.rows(), n * n);
    ASSERT_EQ(fit.cols(), n * n);
    for (int t = 0; t < n * n; ++t) EXPECT_NEAR(fit.row(t).sum(), 1, 1e-9) << n;
  }
}

// The published error of exact texels as a share of the mean: 8.9 % (4), 5.0 % (6), 3.1 % (8) and
// 1.2 % (14) for |b| = a. It is that of a sky along the map's own axis, the worst direction: the
// kinks around the fold. This checks the measure before it is used below.
TEST(TexelFit, UnfittedTexelsHaveThePublishedError) {
  const Function along_axis = [](const Vec3d& d) { return 1 + 2.0 / 3.0 * d.z; };
  const Function across = [](const Vec3d& d) { return 1 + 2.0 / 3.0 * d.x; };
  const std::pair<int, double> published[] = {{4, 0.089}, {6, 0.050}, {8, 0.031}, {14, 0.012}};
  for (const auto& [n, share] : published) {
    EXPECT_NEAR(rmsError(exactTexels(n, along_axis), n, along_axis), share, 0.03 * share) << n;
    EXPECT_LT(rmsError(exactTexels(n, across), n, across), 0.7 * share) << n;
  }
}

struct FitCase {
  int n;
  double sky, degree_two;  // least ratios of the errors, exact texels over fitted ones
};

class FittedTexels : public ::testing::TestWithParam<FitCase> {};

// Measured over these skies, 6 to 14 texels a side: 1.62, 1.58, 1.63, 1.63 for linear skies, 1.71,
// 1.82, 1.91, 1.94 for degree 2. A twentieth less is asked for, and never less than 1.5.
TEST_P(FittedTexels, ReadSmoothFunctionsWithASmallerError) {
  const FitCase& expected = GetParam();
  const Eigen::MatrixXd fit = bilinearFit(expected.n);
  for (const bool sky : {true, false}) {
    Rng rng(2, RngStream::test);
    double exact = 0, fitted = 0;
    for (int i = 0; i < 8; ++i) {
      const Function f = sky ? linearSky(rng) : degreeTwo(rng);
      const Eigen::VectorXd texels = exactTexels(expected.n, f);
      exact += std::pow(rmsError(texels, expected.n, f), 2);
      fitted += std::pow(rmsError(fit * texels, expected.n, f), 2);
    }
    const double ratio = std::sqrt(exact / fitted);
    RecordProperty(sky ? "linear_sky_ratio" : "degree_two_ratio", std::to_string(ratio));
    RecordProperty(sky ? "linear_sky_rms" : "degree_two_rms",
                   std::to_string(std::sqrt(fitted / 8)));
    EXPECT_GT(ratio, sky ? expected.sky : expected.degree_two);
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, FittedTexels,
                         ::testing::Values(FitCase{6, 1.5, 1.62}, FitCase{8, 1.5, 1.73},
                                           FitCase{12, 1.5, 1.8}, FitCase{14, 1.5, 1.84}),
                         [](const auto& info) { return "N" + std::to_string(info.param.n); });

// What the expansion does not hold, such as noise, passes through: the fit must not amplify it.
TEST(TexelFit, NoiseIsNotAmplified) {
  for (const int n : {6, 8, 12}) {
    const Eigen::MatrixXd fit = bilinearFit(n);
    // Independent noise of deviation 1 a texel has deviation |row| after the fit.
    for (int t = 0; t < n * n; ++t) EXPECT_LT(fit.row(t).norm(), 1.5) << n << " texel " << t;
  }
}

TEST(TexelFit, AConstantStaysAConstant) {
  const Eigen::VectorXd fitted = bilinearFit(6) * Eigen::VectorXd::Constant(36, 2.5);
  for (int t = 0; t < 36; ++t) EXPECT_NEAR(fitted[t], 2.5, 1e-9);
}

}  // namespace
}  // namespace probelab
