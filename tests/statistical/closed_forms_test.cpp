// SPDX-License-Identifier: GPL-3.0-or-later
// The path-traced reference against closed forms: a z-test over all points with a family-wise level
// and a hard bound on the bias.
#include "statistical/closed_forms.h"

#include <gtest/gtest.h>

#include "base/rng.h"
#include "scene_builders.h"
#include "statistical/z_test.h"
#include "trace/path_tracer.h"
#include "trace/sampling.h"

namespace probelab::test {
namespace {

Vec3f randomUnit(Rng& rng) { return sampleSphere({rng.nextFloat(), rng.nextFloat()}); }
Vec3f randomIn(Rng& rng, float lo, float hi) {
  return Vec3f(lo) + Vec3f(rng.nextFloat(), rng.nextFloat(), rng.nextFloat()) * (hi - lo);
}

IrradianceEstimate estimate(const Scene& scene, const std::vector<IrradiancePoint>& points,
                            uint32_t spp, uint64_t seed = 1) {
  const EmbreeScene embree(scene);
  SampleBudget budget;
  budget.spp = spp;
  return estimateIrradiance(scene, embree, points, budget, seed);
}

std::vector<IrradiancePoint> pointsIn(float lo, float hi, int count, uint64_t seed) {
  Rng rng(seed, RngStream::test);
  std::vector<IrradiancePoint> points;
  for (int i = 0; i < count; ++i) points.push_back({randomIn(rng, lo, hi), randomUnit(rng)});
  return points;
}

// E = pi Le / (1 - rho) everywhere in a closed box that emits Le.
class Furnace : public testing::TestWithParam<float> {};

TEST_P(Furnace, HasTheSameIrradianceEverywhere) {
  const float albedo = GetParam();
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(1), builder.material(Vec3f(albedo), Vec3f(1)), true);
  const auto result = estimate(builder.finish(), pointsIn(0.01f, 0.99f, 64, 1), 4096);
  // Largest relative standard error of the mean: sqrt(rho) / sqrt(64 * 4096) = 0.19 %; five of it.
  expectTruth(result, M_PI / (1.0 - static_cast<double>(albedo)), 0.01);
}
INSTANTIATE_TEST_SUITE_P(Albedo, Furnace, testing::Values(0.0f, 0.5f, 0.9f));

// Paths of a thousand bounces on average stay finite and unbiased.
TEST(FurnaceExtremes, AlbedoAlmostOneIsUnbiased) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(1), builder.material(Vec3f(0.999f), Vec3f(1)), true);
  const auto result = estimate(builder.finish(), pointsIn(0.1f, 0.9f, 8, 2), 2048);
  expectTruth(result, M_PI / (1.0 - 0.999f), 0.05);
}

TEST(FurnaceExtremes, AlbedoOneEnds) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(1), builder.material(Vec3f(1), Vec3f(1)), true);
  const auto result = estimate(builder.finish(), pointsIn(0.1f, 0.9f, 1, 3), 32);
  EXPECT_TRUE(isFinite(result.a[0]));
}

TEST(Furnace, ColoursStaySeparate) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(1), builder.material(Vec3f(0.8f, 0.4f, 0), Vec3f(1, 2, 3)), true);
  const auto result = estimate(builder.finish(), pointsIn(0.01f, 0.99f, 32, 4), 4096);
  const Vec3d truth(M_PI / 0.2, 2 * M_PI / 0.6, 3 * M_PI);
  expectTruth(result, std::vector<Vec3d>(32, truth), 0.01, 4e-6);
}

TEST(Emitters, UnitSquareOneAbove) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0), Vec3f(1));
  builder.quad(Vec3f(-.5f, 1, -.5f), Vec3f(.5f, 1, -.5f), Vec3f(.5f, 1, .5f), Vec3f(-.5f, 1, .5f),
               m);
  const auto result = estimate(builder.finish(), {{Vec3f(0), Vec3f(0, 1, 0)}}, 1 << 15);
  expectTruth(result, 0.752274688, 0.005);
}

TEST(Emitters, PolygonsFromAnywhereMatchLambertsFormula) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0), Vec3f(1, 2, 5));
  const Vec3f c[4] = {{-1, 2, -1}, {1, 2, -1}, {1, 2, 1.5f}, {-1, 2, 1.5f}};  // faces down
  builder.quad(c[0], c[1], c[2], c[3], m);
  const Scene scene = builder.finish();
  const std::vector<Vec3d> corners = {Vec3d(c[0]), Vec3d(c[1]), Vec3d(c[2]), Vec3d(c[3])};
  const auto points = pointsIn(-2, 1.9f, 256, 5);
  std::vector<Vec3d> truth;
  for (const auto& p : points)
    truth.push_back(Vec3d(1, 2, 5) *
                    polygonIrradiance(Vec3d(p.position), Vec3d(p.normal), corners, 1.0));
  expectTruth(estimate(scene, points, 4096), truth, 0.005);
}

// Stopping at a relative error does not bend the mean.
TEST(Emitters, StayUnbiasedWhenTheErrorDecidesTheSamples) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0), Vec3f(1));
  const Vec3f c[4] = {{-1, 2, -1}, {1, 2, -1}, {1, 2, 1.5f}, {-1, 2, 1.5f}};
  builder.quad(c[0], c[1], c[2], c[3], m);
  const Scene scene = builder.finish();
  const std::vector<Vec3d> corners = {Vec3d(c[0]), Vec3d(c[1]), Vec3d(c[2]), Vec3d(c[3])};
  const auto points = pointsIn(-2, 1.9f, 400, 12);
  double truth = 0;
  for (const auto& p : points)
    truth += polygonIrradiance(Vec3d(p.position), Vec3d(p.normal), corners, 1.0);
  const EmbreeScene embree(scene);
  SampleBudget budget;
  budget.rel_error = 0.02;
  double sum = 0;
  const int runs = 10;
  for (uint64_t seed = 0; seed < runs; ++seed) {
    const auto e = estimateIrradiance(scene, embree, points, budget, seed);
    for (std::size_t i = 0; i < points.size(); ++i)
      sum += 0.5 * static_cast<double>(e.a[i].x + e.b[i].x) / runs;
  }
  // 4,000 estimates of 2 to 10 %, the brightest count most: 0.1 %; three of it.
  EXPECT_NEAR(sum / truth, 1, 0.003);
}

TEST(Emitters, BacksOfSingleSidedOnesAreBlackAndOfDoubleSidedOnesAreNot) {
  for (const bool double_sided : {false, true}) {
    SceneBuilder builder;
    const uint32_t m = builder.material(Vec3f(0), Vec3f(1), double_sided);
    builder.quad(Vec3f(-.5f, 1, -.5f), Vec3f(-.5f, 1, .5f), Vec3f(.5f, 1, .5f), Vec3f(.5f, 1, -.5f),
                 m);  // faces up, seen from below
    const auto result = estimate(builder.finish(), {{Vec3f(0), Vec3f(0, 1, 0)}}, 1 << 13);
    if (double_sided)
      expectTruth(result, 0.752274688, 0.01);
    else
      EXPECT_EQ(result.a[0] + result.b[0], Vec3f(0));
  }
}

TEST(Emitters, DiscOffAxis) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0), Vec3f(1));
  const int sides = 256;
  for (int i = 0; i < sides; ++i) {
    const auto rim = [&](int k) {
      const double phi = 2 * M_PI * k / sides;
      return Vec3f(static_cast<float>(0.5 * std::cos(phi)), 0.8f,
                   static_cast<float>(0.5 * std::sin(phi)));
    };
    builder.triangle(Vec3f(0, 0.8f, 0), rim(i), rim((i + 1) % sides), m);
  }
  const Scene scene = builder.finish();
  std::vector<IrradiancePoint> points;
  std::vector<Vec3d> truth;
  for (const double a : {0.0, 0.3, 1.1, 2.0}) {
    points.push_back({Vec3f(static_cast<float>(a), 0, 0), Vec3f(0, 1, 0)});
    truth.push_back(Vec3d(M_PI * discFactor(0.8, 0.5, a)));
  }
  // The inscribed polygon's area is smaller by (2 pi / sides)^2 / 6 = 1.0e-4.
  expectTruth(estimate(scene, points, 1 << 14), truth, 0.005, 1.5e-4);
}

TEST(Emitters, SphereAboveAndAcrossTheHorizon) {
  SceneBuilder builder;
  builder.sphere(Vec3f(0), 1, 5, builder.material(Vec3f(0), Vec3f(1)), false);
  const Scene scene = builder.finish();
  std::vector<IrradiancePoint> points;
  std::vector<Vec3d> truth;
  for (const double theta : {0.0, 0.7, 1.2, 1.5, 1.8, 2.0}) {
    const double d = 2.5;
    points.push_back(
        {Vec3f(0, 0, static_cast<float>(-d)),
         Vec3f(static_cast<float>(std::sin(theta)), 0, static_cast<float>(std::cos(theta)))});
    truth.push_back(Vec3d(M_PI * sphereFactor(1, d, theta)));
  }
  // Edge of a level-5 icosphere: about 0.04; the radius of its faces is smaller by edge^2 / 6 of
  // the square at most, 3e-4, and the solid angle by twice that; more where the horizon cuts it.
  expectTruth(estimate(scene, points, 1 << 14), truth, 0.006, 1.5e-3);
}

TEST(DeltaLights, InverseSquareCosineAndShadow) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0));
  builder.quad(Vec3f(1, 1, -1), Vec3f(2, 1, -1), Vec3f(2, 1, 1), Vec3f(1, 1, 1), m);
  builder.pointLight(Vec3f(0, 2, 0), Vec3f(8, 4, 2));
  builder.sun(Vec3f(0, -1, 0), Vec3f(3, 3, 3));
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  const std::vector<IrradiancePoint> points = {
      {Vec3f(0), Vec3f(0, 1, 0)},           // lit by both
      {Vec3f(3, 0, 0), Vec3f(0, 1, 0)},     // the blocker hides the point light
      {Vec3f(1.5f, 0, 0), Vec3f(0, 1, 0)},  // the blocker hides the sun
      {Vec3f(0), Vec3f(0, -1, 0)}};
  const auto e = directIrradiance(scene, embree, points);
  EXPECT_NEAR(e[0].x, 8.0 / 4 + 3, 1e-5);
  EXPECT_NEAR(e[1].x, 3, 1e-5);
  EXPECT_NEAR(e[2].x, 8.0 * 2 / std::pow(1.5 * 1.5 + 4, 1.5), 1e-5);
  EXPECT_EQ(e[3], Vec3f(0));
}

// In a diffuse sphere the light that has bounced is uniform: E = rho / (1 - rho) Phi / area, for a
// light anywhere inside; direct light is I (R - s cos) / d^3.
TEST(DiffuseSphere, IndirectLightOfAnOffCentreLightIsUniform) {
  SceneBuilder builder;
  builder.sphere(Vec3f(0), 2, 5, builder.material(Vec3f(0.7f)), true);
  builder.pointLight(Vec3f(0, 1.1f, 0), Vec3f(10));
  const Scene scene = builder.finish();
  double area = 0;
  for (uint32_t i = 0; i < scene.geometry->triangles.size(); ++i)
    area += faceArea(*scene.geometry, i);
  Rng rng(6, RngStream::test);
  std::vector<IrradiancePoint> points;
  std::vector<Vec3d> direct;
  for (int i = 0; i < 64; ++i) {
    const auto triangle = static_cast<uint32_t>(rng.nextBelow(scene.geometry->triangles.size()));
    const auto& t = scene.geometry->triangles[triangle];
    const Vec3f p = pointOnTriangle(scene.geometry->positions[t.vertex[0]],
                                    scene.geometry->positions[t.vertex[1]],
                                    scene.geometry->positions[t.vertex[2]], 0.3f, 0.3f)
                        .position;
    points.push_back({p, faceNormal(*scene.geometry, triangle)});
    const Vec3d to_light = Vec3d(0, 1.1, 0) - Vec3d(p);
    direct.push_back(
        Vec3d(10 * dot(Vec3d(points.back().normal), to_light) / std::pow(length(to_light), 3)));
  }
  const EmbreeScene embree(scene);
  const auto delta = directIrradiance(scene, embree, points);
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_NEAR(delta[i].x, direct[i].x, 1e-5 * direct[i].x);
  const double flux = 4 * M_PI * 10;
  // Facets of a level-5 icosphere are 0.02 rad off the sphere at most: second order, 5e-4.
  expectTruth(estimate(scene, points, 1 << 13), 0.7f / (1 - 0.7f) * flux / area, 0.003, 1e-3);
}

// Emitted flux = absorbed flux in any closed mesh, exactly: the area mean of E_delta + E is
// Phi / (A (1 - rho)). A box with a lamp near one wall and a spot, whose smoothed cone from cosine
// 0.9 to 0.6 has the flux 2 pi I (0.1 + 0.3 / 3).
TEST(ClosedMesh, AbsorbsWhatTheLightEmits) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(2, 1, 3), builder.material(Vec3f(0.6f)), true);
  builder.pointLight(Vec3f(0.5f, 0.5f, 2), Vec3f(1));
  Light spot;
  spot.type = LightType::spot;
  spot.position = Vec3f(1.5f, 0.8f, 1);
  spot.direction = normalize(Vec3f(-1, -1, 0.5f));
  spot.intensity = Vec3f(5);
  spot.cos_inner = 0.9f, spot.cos_outer = 0.6f;
  builder.scene().lights.push_back(spot);
  const double flux = 4 * M_PI + 2 * M_PI * 5 * 0.2;
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  // Stratified over each face, so that the mean over points adds little noise to the test.
  std::vector<IrradiancePoint> points;
  std::vector<double> weights;
  Rng rng(7, RngStream::test);
  const int n = 16;
  for (uint32_t face = 0; face < scene.geometry->triangles.size(); ++face)
    for (int k = 0; k < n * n; ++k) {
      const Vec2f uv = sampleTriangle({(static_cast<float>(k % n) + rng.nextFloat()) / n,
                                       (static_cast<float>(k / n) + rng.nextFloat()) / n});
      const auto& t = scene.geometry->triangles[face];
      points.push_back({pointOnTriangle(scene.geometry->positions[t.vertex[0]],
                                        scene.geometry->positions[t.vertex[1]],
                                        scene.geometry->positions[t.vertex[2]], uv.x, uv.y)
                            .position,
                        faceNormal(*scene.geometry, face)});
      weights.push_back(faceArea(*scene.geometry, face) / (n * n));
    }
  const auto direct = directIrradiance(scene, embree, points);
  SampleBudget budget;
  budget.spp = 256;
  const auto field = estimateIrradiance(scene, embree, points, budget, 3);
  double total = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    total += weights[i] * (static_cast<double>(direct[i].x) +
                           0.5 * static_cast<double>(field.a[i].x + field.b[i].x));
  // 3072 points x 256 samples of spread about 1: 0.12 %; the stratified direct part about as much.
  EXPECT_NEAR(total * (1 - 0.6), flux, 0.006 * flux);
}

TEST(Skies, UniformAndLinear) {
  SceneBuilder builder;
  builder.scene().sky.radiance = Vec3f(1, 0.5f, 2);
  builder.scene().sky.linear = Vec3f(0.5f, -0.3f, 0.6f);
  builder.scene().sky.scale = 2;
  const auto points = pointsIn(-1, 1, 256, 8);
  std::vector<Vec3d> truth;
  for (const auto& p : points) {
    const double b = dot(Vec3d(0.5, -0.3, 0.6), Vec3d(p.normal));
    truth.push_back(Vec3d(2, 1, 4) * (M_PI + 2 * M_PI / 3 * b));
  }
  expectTruth(estimate(builder.finish(), points, 4096), truth, 0.001);

  SceneBuilder uniform;
  uniform.scene().sky.radiance = Vec3f(3);
  // Every sample is exact but for rounding.
  const auto exact = estimate(uniform.finish(), points, 32);
  for (const Vec3f& e : exact.a) EXPECT_NEAR(e.x, 3 * M_PI, 1e-5);
}

// A dim image with one bright texel: quadrature over texels is the truth.
TEST(Skies, ImageWithASmallBrightSun) {
  SceneBuilder builder;
  Sky& sky = builder.scene().sky;
  sky.width = 64, sky.height = 32;
  Rng rng(9, RngStream::test);
  for (int i = 0; i < 64 * 32; ++i) sky.image.push_back(Vec3f(0.5f + rng.nextFloat()));
  sky.image[9 * 64 + 20] = Vec3f(2000, 1500, 1000);
  const auto image = sky.image;
  const auto points = pointsIn(-1, 1, 64, 10);
  std::vector<Vec3d> truth(points.size());
  const int fine = 16;
  for (int y = 0; y < 32 * fine; ++y)
    for (int x = 0; x < 64 * fine; ++x) {
      const double theta = M_PI * (y + 0.5) / (32 * fine);
      const double phi = 2 * M_PI * ((x + 0.5) / (64 * fine) - 0.5);
      const double solid_angle = 2 * M_PI / (64 * fine) * (M_PI / (32 * fine)) * std::sin(theta);
      const Vec3d d(std::sin(theta) * std::sin(phi), std::cos(theta),
                    -std::sin(theta) * std::cos(phi));
      for (std::size_t i = 0; i < points.size(); ++i)
        truth[i] += Vec3d(image[static_cast<std::size_t>(y / fine * 64 + x / fine)]) *
                    (solid_angle * std::max(0.0, dot(d, Vec3d(points[i].normal))));
    }
  // The midpoint rule with 1024 x 512 nodes and a kink at the horizon: 1e-4.
  expectTruth(estimate(builder.finish(), points, 4096), truth, 0.005, 3e-4);
}

// Two boxes, one dark inside, the other a furnace, share nothing: nothing gets in.
TEST(SealedRoom, IsExactlyDarkInside) {
  SceneBuilder builder;
  const uint32_t grey = builder.material(Vec3f(0.7f));
  builder.shell(Vec3f(-2, 0, -2), Vec3f(2, 3, 2), 0.01f, grey, grey);
  builder.quad(Vec3f(-20, -0.01f, -20), Vec3f(-20, -0.01f, 20), Vec3f(20, -0.01f, 20),
               Vec3f(20, -0.01f, -20), grey);
  builder.sun(Vec3f(-0.3f, -1, -0.2f), Vec3f(100000));
  builder.pointLight(Vec3f(2.05f, 1, 0), Vec3f(1000));
  builder.scene().sky.radiance = Vec3f(1000);
  builder.scene().receiver_seeds.push_back(Vec3f(0, 1, 0));
  const Scene scene = builder.finish();
  Rng rng(11, RngStream::test);
  std::vector<IrradiancePoint> points;
  for (int i = 0; i < 512; ++i) {
    Vec3f p(4 * rng.nextFloat() - 2, 3 * rng.nextFloat(), 4 * rng.nextFloat() - 2);
    Vec3f n = randomUnit(rng);
    if (i % 2 == 0) p.x = 2, n = Vec3f(-1, 0, 0);                          // on a wall
    if (i % 8 == 1) p = Vec3f(-2, 0, p.z), n = normalize(Vec3f(1, 1, 0));  // in an edge
    points.push_back({p, n});
  }
  const EmbreeScene embree(scene);
  for (const Vec3f& e : directIrradiance(scene, embree, points)) EXPECT_EQ(e, Vec3f(0));
  const auto field = estimate(scene, points, 1024);
  for (const Vec3f& e : field.a) EXPECT_EQ(e, Vec3f(0));
  for (const Vec3f& e : field.b) EXPECT_EQ(e, Vec3f(0));
}

}  // namespace
}  // namespace probelab::test
