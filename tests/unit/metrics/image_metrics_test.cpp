// SPDX-License-Identifier: GPL-3.0-or-later
#include "metrics/image_metrics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"

namespace probelab {
namespace {

constexpr double kImageRounding = 1e-6;

std::vector<Vec3f> grey(std::initializer_list<float> values) {
  std::vector<Vec3f> pixels;
  for (const float v : values) pixels.emplace_back(v);
  return pixels;
}

TEST(ImageErrors, AreThoseWorkedOutByHand) {
  const ImageMetrics m = computeImageMetrics(grey({4, 1, 0, 4}), grey({2, 1, 1, 4}));  // mean 2
  EXPECT_NEAR(*m.rmse, std::sqrt((4.0 + 1) / 4) / 2, kImageRounding);
  EXPECT_NEAR(*m.mae, 3.0 / 4 / 2, kImageRounding);
  EXPECT_NEAR(*m.bias, 1.0 / 4 / 2, kImageRounding);
  EXPECT_NEAR(*m.relmse, (4 / 4.0004 + 1 / 1.0004) / 4, kImageRounding);
  EXPECT_NEAR(*m.smape, (4 / 6.002 + 2 / 1.002) / 4, kImageRounding);
  EXPECT_NEAR(m.max_abs, 4, kImageRounding);
  EXPECT_FALSE(m.nrmse);
}

TEST(ImageErrors, UseBothHalvesWhereThereAreTwo) {
  const ImageMetrics m =
      computeImageMetrics(grey({4, 1, 0, 4}), grey({1, 1, 1, 4}), grey({3, 1, 1, 4}));
  EXPECT_NEAR(*m.nrmse, std::sqrt(4.0 / 21), kImageRounding);
  EXPECT_NEAR(*m.rmse, std::sqrt((4.0 + 1) / 4) / 2, kImageRounding);  // R = 2, 1, 1, 4
}

TEST(ImageErrors, AreNullForABlackReference) {
  const ImageMetrics m = computeImageMetrics(grey({3, 0}), grey({0, 0}), grey({0, 0}));
  for (const auto& [name, value] : namedMetrics(m))
    EXPECT_EQ(value.has_value(), name == "max_abs") << name;
  EXPECT_NEAR(m.max_abs, 3, kImageRounding);
}

TEST(ImageErrors, RefusePixelsThatAreNotFinite) {
  EXPECT_THROW(computeImageMetrics(grey({1, NAN}), grey({1, 1})), NumericalError);
  EXPECT_THROW(computeImageMetrics(grey({1, 1}), grey({1, INFINITY})), NumericalError);
  EXPECT_THROW(computeImageMetrics(grey({1}), grey({1}), grey({-INFINITY})), NumericalError);
}

}  // namespace
}  // namespace probelab
