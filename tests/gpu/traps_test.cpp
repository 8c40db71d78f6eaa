// SPDX-License-Identifier: GPL-3.0-or-later
// Traps that published implementations fell into, those of geometry, numbers and devices: 6 to 9
// and 12 to 14. Each test shows that Probelab has not the defect.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "gpu/shader.h"
#include "update_oracle.h"

namespace probelab {
namespace {

using test::boxLayout;
using test::exactParams;
using test::FieldScene;
using test::SceneBuilder;

class Traps : public GpuTest {};

constexpr double kPi = std::numbers::pi;

QueryPoint upAt(const Vec3f& p) { return {p, Vec3f(0, 1, 0), Vec3f(0, -1, 0)}; }

// A probe beside a wall keeps the same share of a spacing from it at every size; a step of one
// world unit would throw it out of a small cell, or not move it at all.
TEST_F(Traps, Trap06RelocationKnowsNoWorldUnits) {
  Vec3f share[3];
  for (int i = 0; i < 3; ++i) {
    const float scale = i == 0 ? 1.0f : (i == 1 ? 0x1p-10f : 0x1p10f);
    SceneBuilder builder;
    builder.box(Vec3f(0), Vec3f(4, 3, 5) * scale, builder.material(Vec3f(0.5f)), true);
    const FieldScene scene(builder.finish());
    Params params = loadParams("rtxgi");
    params.relocation = 1;
    const ProbeLayout layout =
        boxLayout({Vec3f(0.05f) * scale, Vec3f(3, 2, 4) * scale}, Vec3i(3), scene.scene.bounds);
    const auto field = scene.field(gpu(), layout, params);
    share[i] = (field->states().positions[0] - layout.positions[0]) / layout.lattice.spacing;
  }
  EXPECT_GT(length(share[0]), 0.1f);
  EXPECT_EQ(share[1], share[0]);
  EXPECT_EQ(share[2], share[0]);
}

// The lattice fills a third of the room. Walls lie outside of it and inside the bounds: their
// bounces count, and the furnace is the closed form.
TEST_F(Traps, Trap07WallsOutsideTheLatticeHaveTheirBounces) {
  const FieldScene scene(test::furnaceScene(0.6f, 1));
  for (const char* preset : {"classic", "gdc2019", "majercik2021", "rtxgi", "probelab"}) {
    Params params = exactParams(preset);
    params.rays = 64;
    const auto field = scene.field(
        gpu(), boxLayout({Vec3f(0.7f), Vec3f(1.3f)}, Vec3i(2), scene.scene.bounds), params);
    convergeField(*field, {.average = 4});
    const double truth = kPi / (1 - 0.6);
    const std::vector<QueryPoint> points{upAt(Vec3f(1, 0, 1)), upAt(Vec3f(0, 0, 2)),
                                         upAt(Vec3f(1.9f, 0.2f, 0.1f))};
    for (const Vec4f& e : field->query(points)) EXPECT_NEAR(e.x, truth, 2e-3 * truth) << preset;
    EXPECT_EQ(field->counters().empty_answers, 0u) << preset;
  }
}

// A dark room (L = 0.001) beside a bright one (1), a wall of 1 m between: the share of the bright
// probes' radiance that shows at a point half-way between the columns of probes.
double leakedShare(GpuContext& gpu, const std::string& preset, double floor) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(4), builder.material(Vec3f(0), Vec3f(0.001f)), true);
  builder.box(Vec3f(5, 0, 0), Vec3f(9, 4, 4), builder.material(Vec3f(0), Vec3f(1)), true);
  builder.scene().bounds = {Vec3f(0), Vec3f(9, 4, 4)};
  const FieldScene scene(builder.finish());
  Params params = exactParams(preset);
  params.encoding_gamma = 1;
  params.average = PL_AVERAGE_LINEAR;
  params.visibility_floor = floor;
  const auto field = scene.field(
      gpu, boxLayout({Vec3f(1.9f, 1, 1), Vec3f(7.1f, 3, 3)}, Vec3i(2), scene.scene.bounds), params);
  field->update(0, {}, {});
  const Vec4f e =
      field->query(std::vector<QueryPoint>{{Vec3f(3.9f, 2, 2), Vec3f(0, 1, 0), Vec3f(0, -1, 0)}})
          .front();
  return (static_cast<double>(e.x) / kPi - 0.001) / 0.999;
}

// Floor 0.05, wrap 0.45 and crush leave a share of the order of 1e-3 to the occluded side, so a
// contrast of 1,000 leaks. Our preset has no floor.
TEST_F(Traps, Trap08OccludedProbesHaveNoWeightWithoutAFloor) {
  const double with_floor = leakedShare(gpu(), "rtxgi", 0.05);
  const double without = leakedShare(gpu(), "probelab", 0);
  RecordProperty("floor_005", std::to_string(with_floor * 1e6) + "e-6");
  RecordProperty("floor_0", std::to_string(without * 1e6) + "e-6");
  EXPECT_GT(with_floor, 1e-5);
  EXPECT_LT(with_floor, 0.0045 * 1.1);  // the published bound at equal trilinear weights
  EXPECT_LT(without, 1e-6);
  EXPECT_EQ(loadParams("probelab").visibility_floor, 0);
}

// The mean of squares, not the square of the mean: beside a corner the variance is that of the
// distances themselves.
TEST_F(Traps, Trap09MomentsHaveTheVarianceOfTheirDistances) {
  const FieldScene scene(test::randomRoom(60));
  Params params = exactParams("rtxgi");
  const ProbeLayout layout =
      boxLayout({Vec3f(0.5f), Vec3f(3.5f, 1.5f, 1.5f)}, Vec3i(3, 2, 2), scene.scene.bounds);
  const auto field = scene.field(gpu(), layout, params);
  field->update(0, {}, {});
  double variance = 0;
  const std::vector<Vec2d> moments = test::storedTexels(*field).moments;
  for (const Vec2d& m : moments) {
    EXPECT_GE(m.y, m.x * m.x * (1 - 1e-5));
    variance += (m.y - m.x * m.x) / static_cast<double>(moments.size());
  }
  EXPECT_GT(variance, 1e-3);
}

// Infinite emission is an error that names the stage, not a white scene.
TEST_F(Traps, Trap09InfinityIsRefusedNotFedBack) {
  const FieldScene scene(test::furnaceScene(0.5f, std::numeric_limits<float>::infinity()));
  const auto field =
      scene.field(gpu(), boxLayout({Vec3f(0.5f), Vec3f(1.5f)}, Vec3i(2), scene.scene.bounds),
                  loadParams("rtxgi"));
  EXPECT_THROW(field->update(0, {}, {}), NumericalError);
}

// A query at a probe's very place, without biases: no direction, but an answer.
TEST_F(Traps, Trap09ZeroVectorsAreNotNormalized) {
  const FieldScene scene(test::furnaceScene(0.5f, 1));
  for (const char* preset : {"gdc2019", "majercik2021", "rtxgi", "probelab"}) {
    Params params = exactParams(preset);
    params.normal_bias = params.view_bias = 0;
    params.relocation = 0;
    const ProbeLayout layout = boxLayout({Vec3f(0.5f), Vec3f(1.5f)}, Vec3i(2), scene.scene.bounds);
    const auto field = scene.field(gpu(), layout, params);
    field->update(0, {}, {});
    std::vector<QueryPoint> points;
    for (const Vec3f& p : layout.positions) points.push_back(upAt(p));
    for (const Vec4f& e : field->query(points)) EXPECT_NEAR(e.x, kPi, 2e-3 * kPi) << preset;
  }
}

// Far below the lattice's first point, coordinates are negative: they are clamped, never wrapped.
TEST_F(Traps, Trap09NegativeCoordinatesAreClamped) {
  const FieldScene scene(test::randomRoom(61));
  const ProbeLayout layout = boxLayout({Vec3f(1.5f, 0.9f, 0.9f), Vec3f(2.5f, 1.2f, 1.2f)},
                                       Vec3i(3, 2, 2), {Vec3f(-20), Vec3f(20)});
  Params params = exactParams("classic");
  const auto field = scene.field(gpu(), layout, params);
  field->update(0, {}, {});
  const std::vector<Vec4f> e =
      field->query(std::vector<QueryPoint>{upAt(Vec3f(-10)), upAt(Vec3f(1.5f, 0.9f, 0.9f)),
                                           upAt(Vec3f(10)), upAt(Vec3f(2.5f, 1.2f, 1.2f))});
  EXPECT_NEAR(e[0].x, e[1].x, 1e-5f * e[1].x);
  EXPECT_NEAR(e[2].x, e[3].x, 1e-5f * e[3].x);
  EXPECT_NE(e[0].x, e[2].x);
}

// A new field is black, whatever the memory held before, and a first update depends on nothing
// else.
TEST_F(Traps, Trap09BuffersStartInitialised) {
  const FieldScene scene(test::randomRoom(62));
  const ProbeLayout layout =
      boxLayout({Vec3f(0.3f), Vec3f(3.7f, 1.7f, 1.7f)}, Vec3i(4, 3, 3), scene.scene.bounds);
  Params params = loadParams("rtxgi");
  params.rays = 64;
  std::vector<Vec3f> texels[2];
  for (auto& after : texels) {
    const auto field = scene.field(gpu(), layout, params);
    for (const Vec3f& t : field->irradianceTexels()) ASSERT_EQ(t, Vec3f(0));
    for (const Vec2f& m : field->momentTexels()) ASSERT_EQ(m, Vec2f(0));
    const Vec4f e = field->query(std::vector<QueryPoint>{upAt(Vec3f(2, 1, 1))}).front();
    EXPECT_EQ(e.x, 0);
    runTemporal(*field, 2);
    after = field->irradianceTexels();
  }
  EXPECT_EQ(texels[0], texels[1]);
}

// 16 rays, 14 x 14 texels, exponent 50: some lobes have no ray. Every texel still holds a distance,
// one that some ray found.
TEST_F(Traps, Trap12EmptyTexelsTakeTheNearestRay) {
  const FieldScene scene(test::randomRoom(63));
  Params params = exactParams("rtxgi");
  params.rays = 16;
  params.backface_shortening = 1;
  const ProbeLayout layout =
      boxLayout({Vec3f(0.3f), Vec3f(3.7f, 1.7f, 1.7f)}, Vec3i(2), scene.scene.bounds);
  const auto field = scene.field(gpu(), layout, params);
  field->update(0, {}, {});
  const std::vector<Vec3f> directions = updateDirections(16, 0, 0);
  const std::vector<Vec2d> moments = test::storedTexels(*field).moments;
  int alone = 0;
  for (std::size_t i = 0; i < moments.size(); ++i) {
    ASSERT_GT(moments[i].x, 0);
    const int texel = static_cast<int>(i % 196);
    const Vec3d u = texelDirection<double>(texel % 14, texel / 14, 14);
    const auto nearest = *std::max_element(
        directions.begin(), directions.end(),
        [&](const Vec3f& a, const Vec3f& b) { return dot(u, Vec3d(a)) < dot(u, Vec3d(b)); });
    if (dot(u, Vec3d(nearest)) > std::pow(1e-4, 1 / 51.0)) continue;
    ++alone;
    const Hit hit = scene.embree.closest({layout.positions[i / 196], 0, nearest, 1e27f});
    const double q = std::min(static_cast<double>(hit.t / layout.support_radius_m), 1.5);
    EXPECT_NEAR(moments[i].x, q, 1e-5 * q);
  }
  EXPECT_GT(alone, 20);  // 3 texels of each probe
}

// Barriers in divergent flow return 0 on a CPU device: no stage of the pipeline has one at all.
// (The textbook baseline has two, in uniform flow; its tests compare it with and without them.)
TEST_F(Traps, Trap13NoStageHasABarrier) {
  int stages = 0;
  for (const std::string& name : shaderFiles()) {
    if (name.rfind("textbook/", 0) == 0) continue;
    ++stages;
    EXPECT_EQ(shaderText(name).find("barrier("), std::string_view::npos) << name;
    EXPECT_EQ(shaderText(name).find("subgroup"), std::string_view::npos) << name;
  }
  EXPECT_GT(stages, 15);
  constexpr uint32_t kOpControlBarrier = 224, kOpMemoryBarrier = 225;
  const auto words = compileShader({"ddgi/probe_stats.comp.glsl",
                                    {{"PL_IRRADIANCE_FORMAT", "1"},
                                     {"PL_MOMENT_FORMAT", "1"},
                                     {"PL_MOMENT_ENCODING", "0"},
                                     {"PL_BORDER", "1"},
                                     {"BIND_STATS", "0"}},
                                    {}});
  for (std::size_t at = 5; at < words.size(); at += words[at] >> 16) {
    ASSERT_GT(words[at] >> 16, 0u);
    EXPECT_NE(words[at] & 0xffffu, kOpControlBarrier);
    EXPECT_NE(words[at] & 0xffffu, kOpMemoryBarrier);
  }
}

// The weight of the bounds is 1 inside and falls linearly to 0 over one s_i; it multiplies the
// answer once, on each axis.
TEST_F(Traps, Trap14TheBoundsFadeOnce) {
  SceneBuilder builder;
  builder.scene().sky.radiance = Vec3f(1);
  builder.scene().bounds = {Vec3f(-2), Vec3f(2)};
  const FieldScene scene(builder.finish());
  for (const char* preset : {"classic", "gdc2019", "majercik2021", "rtxgi", "probelab"}) {
    // s_i = 0.5.
    const auto field = scene.field(
        gpu(), boxLayout({Vec3f(-1), Vec3f(1)}, Vec3i(5), scene.scene.bounds), exactParams(preset));
    field->update(0, {}, {});
    std::vector<QueryPoint> points;
    std::vector<double> expected;
    for (double d = -0.3; d < 0.8; d += 0.05) {
      const double weight = std::clamp(1 - d / 0.5, 0.0, 1.0);
      const auto out = static_cast<float>(2 + d);
      points.push_back(upAt(Vec3f(out, 0.3f, 0)));
      expected.push_back(weight);
      points.push_back(upAt(Vec3f(0.1f, -out, 0.2f)));
      expected.push_back(weight);
      points.push_back(upAt(Vec3f(out, 0.3f, -out)));
      expected.push_back(weight * weight);
    }
    const std::vector<Vec4f> answers = field->query(points);
    for (std::size_t i = 0; i < points.size(); ++i)
      EXPECT_NEAR(answers[i].x, expected[i] * kPi, 1e-3 * kPi) << preset << " point " << i;
  }
}

}  // namespace
}  // namespace probelab
