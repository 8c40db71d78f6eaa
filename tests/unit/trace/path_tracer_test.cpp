// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/path_tracer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "base/rng.h"
#include "scene_builders.h"
#include "trace/reference_image.h"
#include "trace/sampler.h"
#include "trace/sampling.h"

namespace probelab::test {
namespace {

Scene litRoom() {
  SceneBuilder builder;
  const uint32_t wall = builder.material(Vec3f(0.7f, 0.6f, 0.5f));
  const uint32_t lamp = builder.material(Vec3f(0), Vec3f(10));
  builder.box(Vec3f(0), Vec3f(3), wall, true);
  builder.quad(Vec3f(1, 2.9f, 1), Vec3f(2, 2.9f, 1), Vec3f(2, 2.9f, 2), Vec3f(1, 2.9f, 2), lamp);
  builder.pointLight(Vec3f(0.5f, 0.5f, 0.5f), Vec3f(1));
  builder.camera(Vec3f(1.5f, 1.5f, 2.9f), Vec3f(1.5f, 1.5f, 0));
  return builder.finish();
}

std::vector<IrradiancePoint> somePoints(int count) {
  Rng rng(1, RngStream::test);
  std::vector<IrradiancePoint> points;
  for (int i = 0; i < count; ++i) {
    const float x = rng.nextFloat(), y = rng.nextFloat(), z = rng.nextFloat();
    points.push_back({Vec3f(0.1f) + Vec3f(x, y, z) * 2.7f, sampleSphere({x, z})});
  }
  return points;
}

SampleBudget spp(uint32_t count) {
  SampleBudget budget;
  budget.spp = count;
  return budget;
}

bool sameBytes(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3f)) == 0;
}

TEST(Estimate, SameBytesAgainAndWithAnyNumberOfThreads) {
  const Scene scene = litRoom();
  const EmbreeScene embree(scene);
  const auto points = somePoints(50);
  const auto run = [&](int threads, uint64_t seed) {
    const ThreadLimit limit(threads);
    return estimateIrradiance(scene, embree, points, spp(64), seed);
  };
  const auto one = run(1, 5), two = run(2, 5), other = run(2, 6);
  EXPECT_TRUE(sameBytes(one.a, two.a));
  EXPECT_TRUE(sameBytes(one.b, two.b));
  EXPECT_TRUE(sameBytes(one.standard_error, two.standard_error));
  EXPECT_EQ(one.rays.total(), two.rays.total());
  EXPECT_FALSE(sameBytes(one.a, other.a));
}

// Whether points are traced alone or among others changes nothing but their index.
TEST(Estimate, FirstPointDoesNotDependOnTheOthers) {
  const Scene scene = litRoom();
  const EmbreeScene embree(scene);
  const auto points = somePoints(20);
  const auto all = estimateIrradiance(scene, embree, points, spp(64), 1);
  const auto first = estimateIrradiance(scene, embree, std::span(points).first(1), spp(64), 1);
  EXPECT_EQ(all.a[0], first.a[0]);
}

TEST(Estimate, SamplesAreRoundedUpToPairsOfPasses) {
  const Scene scene = litRoom();
  const EmbreeScene embree(scene);
  EXPECT_EQ(estimateIrradiance(scene, embree, somePoints(1), spp(1), 1).samples, 32u);
  EXPECT_EQ(estimateIrradiance(scene, embree, somePoints(1), spp(100), 1).samples, 128u);
}

TEST(Estimate, StopsAtTheRelativeErrorAndSaysWhichItReached) {
  const Scene scene = litRoom();
  const EmbreeScene embree(scene);
  SampleBudget budget;
  budget.rel_error = 0.02;
  const auto result = estimateIrradiance(scene, embree, somePoints(64), budget, 1);
  EXPECT_LE(result.rel_error, 0.02);
  EXPECT_GT(result.rel_error, 0.005);
  // The rule by hand.
  double mean = 0;
  std::vector<double> relative;
  for (std::size_t i = 0; i < 64; ++i) mean += luminance(result.a[i] + result.b[i]) / 128.0;
  for (std::size_t i = 0; i < 64; ++i) {
    const double value = luminance(result.a[i] + result.b[i]) * 0.5;
    const double half_difference = std::abs(luminance(result.a[i] - result.b[i])) * 0.5;
    if (value > 0.01 * mean) relative.push_back(half_difference / value);
  }
  std::sort(relative.begin(), relative.end());
  // The median of |N(0, s)| is 0.67 s; s itself varies between points.
  EXPECT_LT(relative[relative.size() / 2], 0.03);
}

TEST(Estimate, MaxSppEndsWhatCannotConverge) {
  const Scene scene = litRoom();
  const EmbreeScene embree(scene);
  SampleBudget budget;
  budget.rel_error = 1e-9;
  budget.max_spp = 256;
  EXPECT_EQ(estimateIrradiance(scene, embree, somePoints(2), budget, 1).samples, 256u);
}

TEST(Estimate, SecondsEndItAboutThen) {
  const Scene scene = litRoom();
  const EmbreeScene embree(scene);
  SampleBudget budget;
  budget.seconds = 0.3;
  const auto result = estimateIrradiance(scene, embree, somePoints(16), budget, 1);
  EXPECT_GT(result.seconds, 0.1);
  EXPECT_LT(result.seconds, 3);
}

TEST(Estimate, AnUnlitSceneIsExactlyBlackAndStops) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(3), builder.material(Vec3f(0.5f)), true);
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  SampleBudget budget;
  budget.rel_error = 0.01;
  const auto result = estimateIrradiance(scene, embree, somePoints(4), budget, 1);
  for (const Vec3f& e : result.a) EXPECT_EQ(e, Vec3f(0));
  EXPECT_EQ(result.rel_error, 0);
}

TEST(Estimate, BlackWallsReflectNothing) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(3), builder.material(Vec3f(0)), true);
  builder.pointLight(Vec3f(1.5f), Vec3f(100));
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  for (const Vec3f& e : estimateIrradiance(scene, embree, somePoints(8), spp(32), 1).a)
    EXPECT_EQ(e, Vec3f(0));
}

TEST(Estimate, BadPointsAndBudgetsAreErrors) {
  const Scene scene = litRoom();
  const EmbreeScene embree(scene);
  const IrradiancePoint no_normal{Vec3f(1), Vec3f(0)};
  const IrradiancePoint not_finite{Vec3f(NAN), Vec3f(0, 1, 0)};
  EXPECT_THROW(estimateIrradiance(scene, embree, {&no_normal, 1}, spp(32), 1), NumericalError);
  EXPECT_THROW(estimateIrradiance(scene, embree, {&not_finite, 1}, spp(32), 1), NumericalError);
  SampleBudget negative;
  negative.seconds = -1;
  EXPECT_THROW(estimateIrradiance(scene, embree, somePoints(1), negative, 1), InputError);
}

// Emission 1e-6 and 1e6: the same paths, scaled.
TEST(Estimate, IsLinearInEmission) {
  const auto furnace = [](float emission) {
    SceneBuilder builder;
    builder.box(Vec3f(0), Vec3f(3), builder.material(Vec3f(0.5f), Vec3f(emission)), true);
    const Scene scene = builder.finish();
    const EmbreeScene embree(scene);
    return estimateIrradiance(scene, embree, somePoints(4), spp(32), 1).a;
  };
  const auto one = furnace(1), small = furnace(1e-6f), large = furnace(1e6f);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_NEAR(small[i].x * 1e6f, one[i].x, 1e-5f * one[i].x);
    EXPECT_NEAR(large[i].x * 1e-6f, one[i].x, 1e-5f * one[i].x);
  }
}

TEST(ReferenceImage, IsTheSumOfItsLayersAndOfItsHalves) {
  const Scene scene = litRoom();
  const EmbreeScene embree(scene);
  const ReferenceImage image = renderReference(scene, embree, scene.cameras[0], 32, 24, spp(16), 1);
  ASSERT_EQ(image.radiance.size(), 32u * 24u);
  EXPECT_EQ(image.samples, 16u);
  int flat = 0;
  for (std::size_t i = 0; i < image.radiance.size(); ++i) {
    EXPECT_NEAR(image.radiance[i].x, 0.5f * (image.half_a[i].x + image.half_b[i].x),
                1e-5f * image.radiance[i].x);
    // Where one material fills the pixel the layers multiply.
    if (image.albedo[i] != Vec3f(0.7f, 0.6f, 0.5f) && std::abs(image.albedo[i].x - 0.7f) > 1e-5f)
      continue;
    ++flat;
    const float sum =
        image.emission[i].x + image.albedo[i].x * (image.direct[i].x + image.irradiance[i].x) / kPi;
    EXPECT_NEAR(image.radiance[i].x, sum, 1e-4f * sum);
    EXPECT_NEAR(length(image.normal[i]), 1, 1e-5f);
    EXPECT_GT(image.depth[i], 0.1f);
  }
  EXPECT_GT(flat, 500);
}

TEST(ReferenceImage, AgreesWithReceiversOnTheSameSpot) {
  const Scene scene = litRoom();
  const EmbreeScene embree(scene);
  Camera narrow = scene.cameras[0];
  narrow.vertical_fov_rad = 1e-4f;  // one spot on the far wall
  const ReferenceImage spot = renderReference(scene, embree, narrow, 1, 1, spp(1 << 15), 1);
  const IrradiancePoint point{Vec3f(1.5f, 1.5f, 0), Vec3f(0, 0, 1)};
  const auto truth = estimateIrradiance(scene, embree, {&point, 1}, spp(1 << 15), 2);
  const double value = 0.5 * static_cast<double>(truth.a[0].x + truth.b[0].x);
  // Independent estimates: 5 standard errors of their difference.
  const double variance_image = static_cast<double>(spot.variance[0].x) * M_PI * M_PI / (0.7 * 0.7);
  const double error = std::sqrt(variance_image + std::pow(truth.standard_error[0].x, 2));
  EXPECT_NEAR(spot.irradiance[0].x, value, 5 * error);
  const auto direct = directIrradiance(scene, embree, {&point, 1});
  EXPECT_NEAR(spot.direct[0].x, direct[0].x, 1e-3f * direct[0].x);
}

TEST(ReferenceImage, SameBytesWithAnyNumberOfThreads) {
  const Scene scene = litRoom();
  const EmbreeScene embree(scene);
  const auto run = [&](int threads) {
    const ThreadLimit limit(threads);
    return renderReference(scene, embree, scene.cameras[0], 20, 20, spp(8), 3);
  };
  const auto one = run(1), two = run(2);
  EXPECT_TRUE(sameBytes(one.radiance, two.radiance));
  EXPECT_TRUE(sameBytes(one.irradiance, two.irradiance));
  EXPECT_TRUE(sameBytes(one.variance, two.variance));
}

TEST(ReferenceImage, CameraRaysStartTopLeft) {
  Camera camera;
  camera.vertical_fov_rad = 1.5707963f;
  const Ray middle = cameraRay(camera, 200, 100, 100, 50);
  EXPECT_NEAR(middle.direction.z, -1, 1e-6f);
  const Ray top_left = cameraRay(camera, 200, 100, 0, 0);
  // tan 45 degrees = 1 up, twice that to the left.
  EXPECT_NEAR(top_left.direction.y / -top_left.direction.z, 1, 1e-5f);
  EXPECT_NEAR(top_left.direction.x / -top_left.direction.z, -2, 1e-5f);
}

// Elementary intervals: 16 points of a pass hit each of the 16 boxes of area 1/16 once.
TEST(Sampler, APassIsANet) {
  for (uint32_t dimension = 0; dimension < PathSampler::kStratifiedPairs; ++dimension)
    for (uint64_t index = 0; index < 20; ++index)
      for (int split = 0; split <= 4; ++split) {
        std::set<int> boxes;
        const int columns = 1 << split, rows = 16 / columns;
        for (uint32_t s = 0; s < 16; ++s) {
          const Vec2f u = PathSampler(7, RngStream::test, index, 3, s).pair(dimension);
          ASSERT_TRUE(u.x >= 0 && u.x < 1 && u.y >= 0 && u.y < 1);
          boxes.insert(static_cast<int>(u.x * static_cast<float>(columns)) * rows +
                       static_cast<int>(u.y * static_cast<float>(rows)));
        }
        EXPECT_EQ(boxes.size(), 16u) << "dimension " << dimension << " split " << split;
      }
}

}  // namespace
}  // namespace probelab::test
