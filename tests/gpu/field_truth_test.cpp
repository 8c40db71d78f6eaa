// SPDX-License-Identifier: GPL-3.0-or-later
// The field against closed forms: furnace, skies, a diffuse sphere, a sealed room.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/rng.h"
#include "ddgi/snapshot.h"
#include "field_helpers.h"
#include "random_unit.h"

namespace probelab {
namespace {

using test::boxLayout;
using test::exactParams;
using test::FieldScene;
using test::randomUnit;
using test::SceneBuilder;

constexpr float kPi = std::numbers::pi_v<float>;

class FieldTruth : public GpuTest {};

// Points on the walls of the box [0, 2]^3, normals inward, seen from the middle.
std::vector<QueryPoint> wallPoints(int n) {
  Rng rng(1, RngStream::test);
  std::vector<QueryPoint> points;
  for (int i = 0; i < n; ++i) {
    Vec3f p(2 * rng.nextFloat(), 2 * rng.nextFloat(), 2 * rng.nextFloat()), normal;
    const std::size_t axis = rng.nextBelow(3);
    const bool high = rng.nextBelow(2) == 1;
    p[axis] = high ? 2.0f : 0.0f;
    normal[axis] = high ? -1.0f : 1.0f;
    const Vec3f view = p - Vec3f(1);
    points.push_back({p, normal, normalize(view)});
  }
  return points;
}

class Furnace : public GpuTest,
                public ::testing::WithParamInterface<std::tuple<float, const char*>> {};

// E = pi / (1 - albedo) at every wall point. The bound is the one that the design promises; the
// bounce series is settled to 1e-4.
TEST_P(Furnace, FieldIsTheGeometricSeries) {
  const auto [albedo, preset] = GetParam();
  const FieldScene scene(test::furnaceScene(albedo, 1.0f));
  const Box3f box{Vec3f(0.05f), Vec3f(1.95f)};
  const auto field =
      scene.field(gpu(), boxLayout(box, Vec3i(3, 3, 3), scene.scene.bounds), exactParams(preset));
  const ConvergeReport report = convergeField(*field, {.average = 8});
  EXPECT_TRUE(report.settled);
  const float truth = kPi / (1 - albedo);
  for (const Vec4f& e : field->query(wallPoints(500))) {
    EXPECT_NEAR(e.x, truth, 1e-3f * truth);
    EXPECT_NEAR(e.y, truth, 1e-3f * truth);
    EXPECT_NEAR(e.z, truth, 1e-3f * truth);
  }
}

INSTANTIATE_TEST_SUITE_P(Presets, Furnace,
                         ::testing::Combine(::testing::Values(0.5f, 0.9f),
                                            ::testing::Values("classic", "gdc2019", "rtxgi")),
                         [](const auto& info) {
                           return std::string(std::get<1>(info.param)) +
                                  (std::get<0>(info.param) == 0.5f ? "Albedo50" : "Albedo90");
                         });

// Of the series' light rho^n is missing after n updates without history, and with it an update
// leaves h + (1 - h) rho of what was missing.
TEST_F(FieldTruth, WarmUpIsTheSeriesAndThenAMeanOfWhatFollows) {
  constexpr double kAlbedo = 0.7, kHysteresis = 0.8;
  constexpr int kWarmUp = 6;
  const FieldScene scene(test::furnaceScene(static_cast<float>(kAlbedo), 1.0f));
  const Box3f box{Vec3f(0.05f), Vec3f(1.95f)};
  Params params = exactParams("gdc2019");
  params.change_detector = PL_CHANGE_NONE;
  params.hysteresis = kHysteresis;
  params.warm_up = kWarmUp;
  const ProbeLayout layout = boxLayout(box, Vec3i(3, 3, 3), scene.scene.bounds);
  // Shares of history after the sixth update: of 1, 2, 3 and then no more than 4 updates before.
  const std::vector<double> history = {1.0 / 2, 2.0 / 3, 3.0 / 4, 4.0 / 5, 4.0 / 5, 4.0 / 5};
  for (const int updates : {1, 3, 6, 7, 8, 12}) {
    double missing = std::pow(kAlbedo, std::min(updates, kWarmUp));
    for (int i = kWarmUp; i < updates; ++i) {
      const double h = history[static_cast<std::size_t>(i - kWarmUp)];
      missing *= h + (1 - h) * kAlbedo;
    }
    const auto field = scene.field(gpu(), layout, params);
    EXPECT_EQ(runTemporal(*field, updates), updates);
    const auto full = static_cast<float>(std::numbers::pi / (1 - kAlbedo));
    for (const Vec4f& e : field->query(wallPoints(100)))
      EXPECT_NEAR(e.x, full * static_cast<float>(1 - missing), 2e-4f * full) << updates;
  }
}

// The first update has no history to keep; without a warm-up the second one has Params::hysteresis.
TEST(TemporalHysteresis, WithoutWarmUpHistoryIsWholeAtOnce) {
  Params params = loadParams("rtxgi");
  ASSERT_EQ(params.warm_up, 0);
  EXPECT_EQ(temporalHysteresis(params, 0), 0.0f);
  EXPECT_EQ(temporalHysteresis(params, 1), 0.97f);
  params.warm_up = 1;  // a running mean from the first update on
  EXPECT_EQ(temporalHysteresis(params, 0), 0.0f);
  EXPECT_EQ(temporalHysteresis(params, 1), 0.5f);
  EXPECT_EQ(temporalHysteresis(params, 31), 31.0f / 32);
  EXPECT_EQ(temporalHysteresis(params, 33), 0.97f);
  params.hysteresis = 0;
  EXPECT_EQ(temporalHysteresis(params, 5), 0.0f);
}

Scene linearSkyScene(const Vec3f& radiance, const Vec3f& linear) {
  SceneBuilder builder;
  builder.scene().sky.radiance = radiance;
  builder.scene().sky.linear = linear;
  builder.scene().bounds = {Vec3f(-1), Vec3f(1)};
  return builder.finish();
}

// After one update of 1,024 rays every texel holds (pi a + (2 pi / 3) a b.u) / pi for a sky
// a (1 + b.d), to 5e-4 a.
TEST_F(FieldTruth, LinearSkyIsInEveryTexel) {
  const Vec3f a(1.0f, 0.5f, 2.0f), b(0.4f, -0.6f, 0.3f);
  const FieldScene scene(linearSkyScene(a, b));
  Params params = exactParams("classic");
  params.rays = 1024;
  params.irradiance_texels = 8;
  const auto field =
      scene.field(gpu(), boxLayout(scene.scene.bounds, Vec3i(2, 2, 2), scene.scene.bounds), params);
  field->update(0, {}, {});
  const std::vector<Vec3f> texels = field->irradianceTexels();
  for (int probe = 0; probe < 8; ++probe)
    for (int y = 0; y < 6; ++y)
      for (int x = 0; x < 6; ++x) {
        const Vec3f u = texelDirection(static_cast<float>(x), static_cast<float>(y), 6.0f);
        const Vec3f& texel = texels[static_cast<std::size_t>((probe * 8 + y + 1) * 8 + x + 1)];
        const Vec3f truth = a * (1.0f + 2.0f / 3.0f * dot(b, u));
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(texel[c], truth[c], 5e-4f * a[c]);
      }
}

// Misses everywhere: irradiance of the sky, distances clamped.
TEST_F(FieldTruth, ProbesThatSeeNothingHoldTheSkyAndTheClampedDistance) {
  const FieldScene scene(linearSkyScene(Vec3f(2), Vec3f(0)));
  const auto field =
      scene.field(gpu(), boxLayout(scene.scene.bounds, Vec3i(1, 1, 1), scene.scene.bounds),
                  exactParams("rtxgi"));
  field->update(0, {}, {});
  for (const Vec2f& moments : field->momentTexels()) {
    EXPECT_NEAR(moments.x, 1.5f, 1e-5f);
    EXPECT_NEAR(moments.y, 2.25f, 2e-5f);
  }
  const std::vector<Vec4f> e = field->query(wallPoints(20));
  for (std::size_t i = 0; i < e.size(); ++i)
    if (maxComponent(wallPoints(20)[i].position) <= 1.0f) {
      EXPECT_NEAR(e[i].x, 2 * kPi, 2e-4f);
    }
}

// A point light anywhere in a diffuse sphere: the indirect irradiance is
// rho / (1 - rho) Phi / (4 pi R^2) everywhere, on walls and in the air alike.
TEST_F(FieldTruth, DiffuseSphereHasUniformIndirectIrradiance) {
  SceneBuilder builder;
  const float radius = 2.0f, albedo = 0.6f, candela = 5.0f;
  builder.sphere(Vec3f(0), radius, 4, builder.material(Vec3f(albedo)), true);
  builder.pointLight(Vec3f(0.5f, 0.4f, -0.3f), Vec3f(candela));
  const FieldScene scene(builder.finish());
  const auto field =
      scene.field(gpu(), boxLayout({Vec3f(-1.1f), Vec3f(1.1f)}, Vec3i(4, 4, 4), scene.scene.bounds),
                  exactParams("rtxgi"));
  convergeField(*field, {.average = 32});
  Rng rng(2, RngStream::test);
  std::vector<QueryPoint> points;
  for (int i = 0; i < 400; ++i) {
    const Vec3f u = randomUnit(rng);
    points.push_back({u * 1.98f, -u, u});
  }
  // The tessellation's area stands in for 4 pi R^2: 0.3 % smaller at this level.
  const double flux = 4 * std::numbers::pi * candela;
  double area = 0;
  const Geometry& g = *scene.scene.geometry;
  for (const Triangle& t : g.triangles)
    area += 0.5 * length(cross(Vec3d(g.positions[t.vertex[1]]) - Vec3d(g.positions[t.vertex[0]]),
                               Vec3d(g.positions[t.vertex[2]]) - Vec3d(g.positions[t.vertex[0]])));
  const double truth = albedo / (1 - albedo) * flux / area;
  double mean = 0;
  for (const Vec4f& e : field->query(points)) mean += static_cast<double>(e.x) / 400;
  EXPECT_NEAR(mean / truth, 1.0, 0.02);
}

// A dark room with walls of 0.2 m inside a bright sky. Without visibility light leaks in; with it
// at least ten times less.
TEST_F(FieldTruth, SealedRoomLeaksTenTimesLessWithVisibility) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  builder.shell(Vec3f(-1.5f, -1.5f, -1.5f), Vec3f(1.5f, 1.5f, 1.5f), 0.2f, m, m);
  builder.scene().sky.radiance = Vec3f(1);
  builder.scene().bounds = {Vec3f(-4), Vec3f(4)};
  const FieldScene scene(builder.finish());
  const ProbeLayout layout =
      boxLayout({Vec3f(-3.5f), Vec3f(3.5f)}, Vec3i(7, 7, 7), scene.scene.bounds);
  Rng rng(3, RngStream::test);
  std::vector<QueryPoint> points;
  for (int i = 0; i < 500; ++i) {
    Vec3f p(3 * rng.nextFloat() - 1.5f, 3 * rng.nextFloat() - 1.5f, 3 * rng.nextFloat() - 1.5f);
    Vec3f normal;
    const std::size_t axis = rng.nextBelow(3);
    p[axis] = rng.nextBelow(2) == 1 ? 1.5f : -1.5f;
    normal[axis] = p[axis] > 0 ? -1.0f : 1.0f;
    points.push_back({p, normal, -normal});
  }
  double leak[2];
  for (const int i : {0, 1}) {
    const auto field = scene.field(gpu(), layout, exactParams(i == 0 ? "classic" : "rtxgi"));
    convergeField(*field, {.average = 16});
    leak[i] = 0;
    for (const Vec4f& e : field->query(points)) leak[i] += static_cast<double>(e.x) / 500;
  }
  EXPECT_GT(leak[0], 0.01);
  EXPECT_LT(leak[1], 0.1 * leak[0]);
  RecordProperty("classic", std::to_string(leak[0]));
  RecordProperty("rtxgi", std::to_string(leak[1]));
}

}  // namespace
}  // namespace probelab
