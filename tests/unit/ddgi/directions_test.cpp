// SPDX-License-Identifier: GPL-3.0-or-later
// Directions of an update: even over the sphere, turned by uniform rotations.
#include "ddgi/directions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "shared/octahedral.h"

namespace probelab {
namespace {

TEST(Directions, RotationsAreOrthonormalAndProper) {
  for (uint64_t update = 0; update < 500; ++update) {
    const auto r = randomRotation(3, update);
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(dot(r[i], r[j]), i == j ? 1 : 0, 1e-12);
    EXPECT_NEAR(dot(cross(r[0], r[1]), r[2]), 1, 1e-12);
  }
}

// First and second moments of rotated vectors against the uniform sphere, mean 0 and 1/3 on the
// diagonal. A component is uniform in [-1, 1]: variance 1/3 of its mean, 4/45 of a square's, 1/15
// of a product's. Bounds: 4.5 standard errors of the mean over the updates; 45 comparisons.
TEST(Directions, RotationsAreUniform) {
  constexpr int kUpdates = 20000;
  const double root = std::sqrt(static_cast<double>(kUpdates));
  double mean[3][3] = {}, second[3][3][3] = {};  // [column: image of an axis]
  for (uint64_t update = 0; update < kUpdates; ++update) {
    const auto r = randomRotation(11, update);
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (std::size_t i = 0; i < 3; ++i) {
        mean[axis][i] += r[i][axis] / kUpdates;
        for (std::size_t j = 0; j < 3; ++j)
          second[axis][i][j] += r[i][axis] * r[j][axis] / kUpdates;
      }
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(mean[axis][i], 0, 4.5 * std::sqrt(1.0 / 3) / root);
      for (std::size_t j = 0; j < 3; ++j)
        EXPECT_NEAR(second[axis][i][j], i == j ? 1.0 / 3 : 0,
                    4.5 * std::sqrt(i == j ? 4.0 / 45 : 1.0 / 15) / root);
    }
}

// The angle of a uniform rotation has density (1 - cos a) / pi on [0, pi]: the mean of its cosine,
// (trace - 1) / 2, is -1/2, the mean of its square 1/2, so the variance is 1/4.
TEST(Directions, RotationAnglesFollowHaarsMeasure) {
  constexpr int kUpdates = 20000;
  double sum = 0;
  for (uint64_t update = 0; update < kUpdates; ++update) {
    const auto r = randomRotation(12, update);
    sum += (r[0].x + r[1].y + r[2].z - 1) / 2;
  }
  EXPECT_NEAR(sum / kUpdates, -0.5, 4 * 0.5 / std::sqrt(static_cast<double>(kUpdates)));
}

// Points of the published formula, and their moments: heights are the midpoints of n equal slices,
// so the mean height is 0 and the mean square 1/3 - 1/(3 n^2), exactly; around the axis the golden
// angle cancels the rest to about 1/n.
TEST(Directions, FibonacciPointsAreEven) {
  for (const int n : {16, 100, 256, 1024}) {
    const std::vector<Vec3d> points = sphericalFibonacci(n);
    ASSERT_EQ(points.size(), static_cast<std::size_t>(n));
    Vec3d mean;
    double second[3][3] = {};
    for (std::size_t k = 0; k < points.size(); ++k) {
      EXPECT_NEAR(dot(points[k], points[k]), 1, 1e-12);
      EXPECT_NEAR(points[k].z, 1 - (2.0 * static_cast<double>(k) + 1) / n, 1e-12);
      mean += points[k] / static_cast<double>(n);
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) second[i][j] += points[k][i] * points[k][j] / n;
    }
    EXPECT_NEAR(mean.z, 0, 1e-12);
    EXPECT_NEAR(second[2][2], 1.0 / 3 - 1 / (3.0 * n * n), 1e-12);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(mean[i], 0, 1.0 / n);
      for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(second[i][j], i == j ? 1.0 / 3 : 0, 2.0 / n);
    }
  }
}

// Equal cells of the map's sphere hold equal shares over many updates.
TEST(Directions, ManyUpdatesCoverTheSphereEvenly) {
  constexpr int kRays = 64, kUpdates = 2000;
  double octants[8] = {};
  for (uint64_t update = 0; update < kUpdates; ++update)
    for (const Vec3f& d : updateDirections(kRays, 5, update))
      octants[(d.x > 0 ? 1 : 0) + (d.y > 0 ? 2 : 0) + (d.z > 0 ? 4 : 0)] += 1.0 / kUpdates;
  // Of one update's 64 rays 8 fall in an octant; independent rays would scatter by sqrt(7), the
  // even set scatters less. 4 standard errors of the mean at that deviation: an upper bound.
  for (const double count : octants) EXPECT_NEAR(count, 8, 4 * std::sqrt(7.0 / kUpdates));
}

TEST(Directions, AreAFunctionOfSeedAndUpdate) {
  EXPECT_EQ(updateDirections(32, 1, 2), updateDirections(32, 1, 2));
  EXPECT_NE(updateDirections(32, 1, 2), updateDirections(32, 2, 2));
  EXPECT_NE(updateDirections(32, 1, 2), updateDirections(32, 1, 3));
}

}  // namespace
}  // namespace probelab
