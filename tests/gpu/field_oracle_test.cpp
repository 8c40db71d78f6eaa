// SPDX-License-Identifier: GPL-3.0-or-later
// The field's stages against plain C++: one update by path tracer parts and double sums, the query
// of the shared header, the other tracer, other batch sizes and thread counts.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>

#include "base/parallel.h"
#include "base/rng.h"
#include "ddgi/directions.h"
#include "ddgi/snapshot.h"
#include "field_helpers.h"
#include "random_unit.h"
#include "scene/load.h"
#include "trace/path_tracer.h"
#include "update_oracle.h"

namespace probelab {
namespace {

using test::boxLayout;
using test::exactParams;
using test::FieldScene;
using test::randomUnit;
using test::RayValue;
using test::SceneBuilder;
using test::Texels;
using test::traceValue;

class FieldOracle : public GpuTest {};

// Two coloured rooms joined by a gap, a lamp in one, emission, a double-sided sheet.
Scene roomScene() {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(4, 2, 2), builder.material(Vec3f(0.6f, 0.5f, 0.4f)), true);
  const uint32_t red = builder.material(Vec3f(0.7f, 0.1f, 0.1f));
  builder.box(Vec3f(1.9f, 0, 0.8f), Vec3f(2.1f, 2, 2), red, false);
  const uint32_t lamp = builder.material(Vec3f(0.2f), Vec3f(3, 4, 5));
  builder.quad(Vec3f(0.5f, 1.99f, 0.5f), Vec3f(1, 1.99f, 0.5f), Vec3f(1, 1.99f, 1),
               Vec3f(0.5f, 1.99f, 1), lamp);
  const uint32_t sheet = builder.material(Vec3f(0.3f, 0.8f, 0.3f), Vec3f(), true);
  builder.quad(Vec3f(3, 0.5f, 0.5f), Vec3f(3, 0.5f, 1.5f), Vec3f(3, 1.5f, 1.5f),
               Vec3f(3, 1.5f, 0.5f), sheet);
  builder.pointLight(Vec3f(0.7f, 1.2f, 0.4f), Vec3f(2, 1.5f, 1));
  builder.sun(Vec3f(0.3f, -1, 0.2f), Vec3f(1));
  return builder.finish();
}

ProbeLayout roomLayout(const Scene& scene) {
  return boxLayout({Vec3f(0.2f, 0.2f, 0.2f), Vec3f(3.8f, 1.8f, 1.7f)}, Vec3i(4, 3, 2),
                   scene.bounds);
}

std::vector<QueryPoint> pointsAbout(const Box3f& box, int n, uint64_t seed) {
  Rng rng(seed, RngStream::test);
  std::vector<QueryPoint> points;
  for (int i = 0; i < n; ++i) {
    const Vec3f u(rng.nextFloat(), rng.nextFloat(), rng.nextFloat());
    const Vec3f p = box.min - Vec3f(0.3f) + u * (box.extent() + Vec3f(0.6f));
    points.push_back({p, randomUnit(rng), randomUnit(rng)});
  }
  return points;
}

// One update without hysteresis, all in double, straight from the formulas of [M19].
Texels updateByHand(const FieldScene& scene, const ProbeLayout& layout, const Params& params,
                    uint64_t seed, uint64_t rotation, const FieldSnapshot* previous) {
  const PathTracer tracer(scene.scene, scene.embree);
  const std::vector<Vec3f> directions = updateDirections(params.rays, seed, rotation);
  Texels texels;
  const AtlasSides sides = atlasSides(params);
  // A lobe ends where less than 1e-4 of it lies outside: the share below cosine c is c^(p + 1).
  const double cutoff = std::pow(1e-4, 1 / (params.distance_exponent + 1));
  for (const Vec3f& p : layout.positions) {
    std::vector<RayValue> values;
    for (const Vec3f& d : directions)
      values.push_back(traceValue(tracer, scene.embree, p, d, previous));
    const auto forEachTexel = [&](int side, const auto& add) {
      for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
          add(texelDirection(static_cast<double>(x), static_cast<double>(y),
                             static_cast<double>(side)));
    };
    const auto back = std::count_if(values.begin(), values.end(),
                                    [](const RayValue& v) { return v.distance < 0; });
    const bool frozen = static_cast<double>(back) > params.backface_freeze * params.rays;
    forEachTexel(sides.irradiance, [&](const Vec3d& u) {
      Vec3d sum;
      double weights = 0;
      for (std::size_t r = 0; r < values.size(); ++r) {
        const double w = std::max(0.0, dot(u, Vec3d(directions[r])));
        if (params.backface_skip != 0 && values[r].distance < 0) continue;
        sum += values[r].radiance * w;
        weights += w;
      }
      const Vec3d mean = weights > 0 && !frozen ? sum / weights : Vec3d();
      texels.irradiance.push_back(pow(mean, Vec3d(1 / params.encoding_gamma)));
    });
    forEachTexel(sides.moments, [&](const Vec3d& u) {
      Vec2d sum;
      double weights = 0;
      for (std::size_t r = 0; r < values.size(); ++r) {
        const double cosine = std::max(0.0, dot(u, Vec3d(directions[r])));
        if (cosine <= cutoff) continue;
        const double w = std::pow(cosine, params.distance_exponent);
        double d = values[r].distance;
        if (d < 0) d *= -params.backface_shortening;
        const double q = std::min(d / layout.support_radius_m, params.distance_clamp);
        sum += Vec2d(q, q * q) * w;
        weights += w;
      }
      texels.moments.push_back(weights > 0 ? sum / weights : Vec2d());
    });
  }
  return texels;
}

void expectExactTexels(ProbeField& field, const Texels& expected) {
  const std::vector<Vec3f> irradiance = field.irradianceTexels();
  const std::vector<Vec2f> moments = field.momentTexels();
  const auto interior = [](std::size_t i, int side) {
    const auto n = static_cast<std::size_t>(side - 2), s = static_cast<std::size_t>(side);
    const std::size_t probe = i / (n * n), y = i / n % n, x = i % n;
    return (probe * s + y + 1) * s + x + 1;
  };
  // Blending tolerance 1e-4: of the largest value, since sums cancel nothing.
  double largest = 0;
  for (const Vec3d& e : expected.irradiance) largest = std::max(largest, maxComponent(e));
  ASSERT_GT(largest, 0);
  for (std::size_t i = 0; i < expected.irradiance.size(); ++i) {
    const Vec3f& texel = irradiance[interior(i, field.params().irradiance_texels)];
    for (std::size_t c = 0; c < 3; ++c)
      ASSERT_NEAR(texel[c], expected.irradiance[i][c], 1e-4 * largest) << "texel " << i;
  }
  if (field.params().visibility == 0) return;
  for (std::size_t i = 0; i < expected.moments.size(); ++i) {
    const Vec2f& texel = moments[interior(i, field.params().moment_texels)];
    ASSERT_NEAR(texel.x, expected.moments[i].x, 1e-4 * 1.5) << "texel " << i;
    ASSERT_NEAR(texel.y, expected.moments[i].y, 1e-4 * 2.25) << "texel " << i;
  }
}

class UpdateOracle : public GpuTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(UpdateOracle, TwoUpdatesEqualTheFormulas) {
  const FieldScene scene(roomScene());
  const ProbeLayout layout = roomLayout(scene.scene);
  Params params = exactParams(GetParam());
  params.rays = 200;
  const auto field = scene.field(gpu(), layout, params, {.seed = 7});
  field->update(0, {}, {});
  expectExactTexels(*field, updateByHand(scene, layout, params, 7, 0, nullptr));
  const FieldSnapshot first = takeSnapshot(*field);
  field->update(1, {}, {});
  expectExactTexels(*field, updateByHand(scene, layout, params, 7, 1, &first));
}

INSTANTIATE_TEST_SUITE_P(Presets, UpdateOracle, ::testing::Values("classic", "gdc2019", "rtxgi"),
                         [](const auto& info) { return std::string(info.param); });

class UpdateOnMemory : public GpuMemoryModeTest {};

// The same with the paths of a discrete GPU, where nothing is mapped that need not be.
TEST_P(UpdateOnMemory, EqualsTheFormulasWithBothTracers) {
  const FieldScene scene(roomScene());
  const ProbeLayout layout = roomLayout(scene.scene);
  Params params = exactParams("rtxgi");
  params.rays = 100;
  const Texels expected = updateByHand(scene, layout, params, 7, 0, nullptr);
  for (const TracerKind tracer : {TracerKind::embree, TracerKind::rayquery}) {
    if (tracer == TracerKind::rayquery && !gpu().info().ray_query) continue;
    const auto field = scene.field(gpu(), layout, params, {.seed = 7, .tracer = tracer});
    field->update(0, {}, {});
    expectExactTexels(*field, expected);
  }
}

INSTANTIATE_TEST_SUITE_P(Memory, UpdateOnMemory, ::testing::Bool(), memoryModeName);

// Shipped scenes bring textures, spots and skies.
TEST_F(FieldOracle, UpdateEqualsTheFormulasOnShippedScenes) {
  for (const char* name : {"cornell", "sun_room", "mixed_scale"}) {
    SCOPED_TRACE(name);
    const FieldScene scene(
        loadScene(std::string(PROBELAB_SOURCE_DIR "/scenes/") + name + "/scene.toml"));
    const Box3f& bounds = scene.scene.bounds;
    const Vec3f margin = bounds.extent() * 0.1f;
    const ProbeLayout layout =
        boxLayout({bounds.min + margin, bounds.max - margin}, Vec3i(3, 2, 3), bounds);
    Params params = exactParams("rtxgi");
    params.rays = 128;
    const auto field = scene.field(gpu(), layout, params, {.seed = 3});
    field->update(0, {}, {});
    expectExactTexels(*field, updateByHand(scene, layout, params, 3, 0, nullptr));
  }
}

class QueryOracle : public GpuTest, public ::testing::WithParamInterface<const char*> {};

// GLSL against C++, in float and in double, points outside the bounds included; the format does not
// matter since both read the stored texels.
TEST_P(QueryOracle, DeviceEqualsHost) {
  const FieldScene scene(roomScene());
  const Params params = loadParams(GetParam());
  const auto field = scene.field(gpu(), roomLayout(scene.scene), params);
  for (uint64_t i = 0; i < 3; ++i) field->update(i, {}, {});
  const FieldSnapshot snapshot = takeSnapshot(*field);
  const std::vector<QueryPoint> points = pointsAbout(scene.scene.bounds, 4000, 11);
  const std::vector<Vec4f> device = field->query(points);
  double largest_tap = 0;
  for (const Vec3f& texel : snapshot.irradiance)
    largest_tap =
        std::max(largest_tap, std::numbers::pi * std::pow(static_cast<double>(maxComponent(texel)),
                                                          params.encoding_gamma));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto host = querySnapshot<double>(snapshot, snapshot.params, points[i]);
    const auto host_f =
        querySnapshot<float>(snapshot, convertQueryParams<float>(snapshot.params), points[i]);
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = c == 0 ? device[i].x : (c == 1 ? device[i].y : device[i].z);
      ASSERT_NEAR(value, host.irradiance[c], 1e-4 * largest_tap) << "point " << i;
      ASSERT_NEAR(value, host_f.irradiance[c], 1e-4 * largest_tap) << "point " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Presets, QueryOracle, ::testing::Values("classic", "gdc2019", "rtxgi"),
                         [](const auto& info) { return std::string(info.param); });

// Every pair of map points that mean one direction reads the same value, on the folds of the map
// and at its corners: the border repeats the right texels.
class SeamTest : public GpuTest, public ::testing::WithParamInterface<bool> {};

TEST_P(SeamTest, MapsAreContinuousAcrossSeamsAndCorners) {
  const FieldScene scene(roomScene());
  Params params = exactParams("rtxgi");
  params.border = GetParam() ? 1 : 0;
  const auto field = scene.field(gpu(), roomLayout(scene.scene), params);
  field->update(0, {}, {});
  const FieldSnapshot snapshot = takeSnapshot(*field);
  const int border = snapshot.lattice.border;
  const auto read = [&](int probe, const Vec2d& map) {
    return readIrradiance(snapshot, probe,
                          mapTaps(map, snapshot.lattice.irradiance_texels, border));
  };
  const auto readDepth = [&](int probe, const Vec2d& map) {
    return readMoments(snapshot, probe, mapTaps(map, snapshot.lattice.moment_texels, border));
  };
  Rng rng(5, RngStream::test);
  for (int i = 0; i < 2000; ++i) {
    const int probe = static_cast<int>(rng.nextBelow(24));
    const double t = i < 8 ? (i % 2 == 0 ? 1 : -1) : 2 * rng.nextDouble() - 1;
    const double side = rng.nextBelow(2) == 1 ? 1 : -1;
    const bool vertical = rng.nextBelow(2) == 1;
    const Vec2d a = vertical ? Vec2d(side, t) : Vec2d(t, side);
    const Vec2d b = vertical ? Vec2d(side, -t) : Vec2d(-t, side);
    ASSERT_NEAR(length(octDecode(a) - octDecode(b)), 0, 1e-12);
    EXPECT_NEAR(length(read(probe, a) - read(probe, b)), 0, 1e-6);
    EXPECT_NEAR(readDepth(probe, a).x, readDepth(probe, b).x, 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(Borders, SeamTest, ::testing::Bool(), [](const auto& info) {
  return std::string(info.param ? "Stored" : "Wrapped");
});

TEST_F(FieldOracle, TracersAgree) {
  if (!gpu().info().ray_query) GTEST_SKIP() << "the device has no ray query";
  const FieldScene scene(roomScene());
  const ProbeLayout layout = roomLayout(scene.scene);
  const std::vector<QueryPoint> points = pointsAbout(scene.scene.bounds, 2000, 12);
  std::vector<Vec4f> answers[2];
  for (const int i : {0, 1}) {
    const auto field = scene.field(gpu(), layout, exactParams("rtxgi"),
                                   {.tracer = i == 0 ? TracerKind::embree : TracerKind::rayquery});
    convergeField(*field, {.average = 8});
    answers[i] = field->query(points);
  }
  double error = 0, total = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d a(answers[0][i].x, answers[0][i].y, answers[0][i].z);
    const Vec3d b(answers[1][i].x, answers[1][i].y, answers[1][i].z);
    error += dot(a - b, a - b);
    total += dot(a, a);
  }
  EXPECT_LT(std::sqrt(error / total), 1e-4);
}

// Bytes of the atlases after three updates.
std::vector<Vec3f> atlasAfterUpdates(GpuContext& gpu, const FieldScene& scene,
                                     const FieldSettings& settings) {
  const auto field = scene.field(gpu, roomLayout(scene.scene), loadParams("rtxgi"), settings);
  runTemporal(*field, 3);
  return field->irradianceTexels();
}

TEST_F(FieldOracle, BatchesThreadsAndRepeatsChangeNoByte) {
  const FieldScene scene(roomScene());
  const std::vector<Vec3f> once = atlasAfterUpdates(gpu(), scene, {.seed = 1});
  EXPECT_EQ(once, atlasAfterUpdates(gpu(), scene, {.seed = 1}));
  // 5 probes a batch, and one.
  const uint64_t probe_bytes = rayBytes(true) * 256;
  EXPECT_EQ(once,
            atlasAfterUpdates(gpu(), scene, {.seed = 1, .working_set_bytes = 5 * probe_bytes}));
  EXPECT_EQ(once, atlasAfterUpdates(gpu(), scene, {.seed = 1, .working_set_bytes = 1}));
  {
    const ThreadLimit one_thread(1);
    EXPECT_EQ(once, atlasAfterUpdates(gpu(), scene, {.seed = 1}));
  }
  EXPECT_NE(once, atlasAfterUpdates(gpu(), scene, {.seed = 2}));
}

}  // namespace
}  // namespace probelab
