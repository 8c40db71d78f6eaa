// SPDX-License-Identifier: GPL-3.0-or-later
// Whole updates of random scenes against the formulas in plain C++ (update_oracle.h), for every
// switch of rays, blending and storage, with and without history.
#include <functional>
#include <string>

#include "shared/octahedral.h"
#include "update_oracle.h"

namespace probelab {
namespace {

using test::boxLayout;
using test::exactParams;
using test::FieldScene;
using test::Texels;
using test::UpdateByHand;

ProbeLayout roomLayout(const Scene& scene, const Vec3i& count) {
  return boxLayout({Vec3f(0.2f, 0.2f, 0.2f), Vec3f(3.8f, 1.8f, 1.7f)}, count, scene.bounds);
}

struct BlendCase {
  std::string name;
  std::function<void(Params&)> change;
  Vec3i count = Vec3i(4, 2, 2);
  std::string preset = "rtxgi";
  uint64_t scene = 5;
};

class BlendOracle : public GpuTest, public ::testing::WithParamInterface<BlendCase> {};

// A first write, and two updates with history; each from the texels that the field stored before.
TEST_P(BlendOracle, ThreeUpdatesEqualTheFormulas) {
  const FieldScene scene(test::randomRoom(GetParam().scene));
  Params params = exactParams(GetParam().preset);
  params.rays = 100;
  GetParam().change(params);
  const auto field =
      scene.field(gpu(), roomLayout(scene.scene, GetParam().count), params, {.seed = 7});
  const UpdateByHand hand(scene, *field);
  const double hysteresis[] = {0, 0.7, 0.3};
  for (uint64_t u = 0; u < 3; ++u) {
    SCOPED_TRACE("update " + std::to_string(u));
    const FieldSnapshot previous = takeSnapshot(*field);
    const Texels expected = hand.update(u, hysteresis[u], test::storedTexels(*field), &previous);
    const BlendMode mode{.hysteresis = static_cast<float>(hysteresis[u])};
    field->update(u, mode, mode);
    test::expectTexels(*field, expected);
  }
  EXPECT_EQ(field->counters().non_finite_rays, 0u);
}

const BlendCase kCases[] = {
    {"rtxgi", [](Params&) {}},
    {"classic", [](Params&) {}, Vec3i(4, 2, 2), "classic", 11},
    {"gdc2019", [](Params&) {}, Vec3i(4, 2, 2), "gdc2019", 12},
    {"majercik2021", [](Params&) {}, Vec3i(4, 2, 2), "majercik2021", 13},
    {"probelab", [](Params&) {}, Vec3i(4, 2, 2), "probelab", 14},
    {"no_border", [](Params& p) { p.border = 0; }},
    {"central_moments", [](Params& p) { p.moment_encoding = PL_MOMENTS_CENTRAL; }},
    {"backfaces_count", [](Params& p) { p.backface_skip = 0, p.backface_freeze = 1; }},
    {"backfaces_skipped", [](Params& p) { p.backface_freeze = 1; }},
    {"freeze_at_once", [](Params& p) { p.backface_freeze = 0; }},
    {"fitted", [](Params& p) { p.irradiance_fit = 1, p.encoding_gamma = 1; }},
    {"fitted_skipping",
     [](Params& p) {
       p.irradiance_fit = 1, p.encoding_gamma = 1;
       p.backface_skip = 1, p.backface_freeze = 1;
     },
     Vec3i(4, 2, 2), "probelab"},
    {"gamma_1", [](Params& p) { p.encoding_gamma = 1; }},
    {"gamma_2", [](Params& p) { p.encoding_gamma = 2; }},
    {"linear_history", [](Params& p) { p.hysteresis_space = 1; }},
    {"linear_history_m21",
     [](Params& p) { p.hysteresis_space = 1, p.change_detector = PL_CHANGE_M21; }},
    {"no_detector", [](Params& p) { p.change_detector = PL_CHANGE_NONE; }},
    {"no_feedback", [](Params& p) { p.feedback = 0; }},
    {"no_visibility", [](Params& p) { p.visibility = 0; }},
    {"clamped_radiance", [](Params& p) { p.radiance_clamp = 0.4; }},
    {"by_direction", [](Params& p) { p.ray_order = PL_RAYS_BY_DIRECTION; }},
    {"rays_16", [](Params& p) { p.rays = 16; }},
    {"rays_1024", [](Params& p) { p.rays = 1024; }, Vec3i(2, 2, 1)},
    {"broad_lobe", [](Params& p) { p.distance_exponent = 2; }},
    {"narrow_lobe", [](Params& p) { p.distance_exponent = 300; }},
    {"short_distances", [](Params& p) { p.distance_clamp = 0.5, p.backface_shortening = 1; }},
    {"one_probe", [](Params&) {}, Vec3i(1, 1, 1), "rtxgi", 2},
    {"lattice_2x1x3", [](Params&) {}, Vec3i(2, 1, 3)},
    {"lattice_17x3x5", [](Params& p) { p.rays = 20; }, Vec3i(17, 3, 5)},
    {"rgba16f_rg16f",
     [](Params& p) {
       p.irradiance_format = PL_FORMAT_RGBA16F;
       p.moment_format = PL_FORMAT_RG16F;
     }},
    {"r11g11b10f", [](Params& p) { p.irradiance_format = PL_FORMAT_R11G11B10F; }},
    {"rgb10a2", [](Params& p) { p.irradiance_format = PL_FORMAT_RGB10A2; }},
    {"rg16f_central",
     [](Params& p) {
       p.moment_format = PL_FORMAT_RG16F;
       p.moment_encoding = PL_MOMENTS_CENTRAL;
     }},
    {"r11g11b10f_dithered",
     [](Params& p) { p.irradiance_format = PL_FORMAT_R11G11B10F, p.rounding = 1; }},
    {"rgb10a2_dithered",
     [](Params& p) { p.irradiance_format = PL_FORMAT_RGB10A2, p.rounding = 1; }},
    {"rg16f_dithered",
     [](Params& p) {
       p.irradiance_format = PL_FORMAT_RGBA16F, p.moment_format = PL_FORMAT_RG16F;
       p.moment_encoding = PL_MOMENTS_CENTRAL, p.rounding = 1;
     }},
    {"smallest_maps", [](Params& p) { p.irradiance_texels = 3, p.moment_texels = 3; }},
    {"odd_maps", [](Params& p) { p.irradiance_texels = 5, p.moment_texels = 11, p.border = 0; }},
};

INSTANTIATE_TEST_SUITE_P(Switches, BlendOracle, ::testing::ValuesIn(kCases),
                         [](const auto& info) { return info.param.name; });

class BlendStages : public GpuTest {};

// Relocated probes, inactive probes: the list of probes leads to the right places.
TEST_F(BlendStages, ProbesThatMovedOrSleepEqualTheFormulas) {
  const FieldScene scene(test::randomRoom(77));
  Params params = exactParams("rtxgi");
  params.rays = 64;
  params.relocation = 1;
  params.classification = PL_CLASSIFY_INSIDE;
  const auto field = scene.field(gpu(), roomLayout(scene.scene, Vec3i(9, 5, 5)), params);
  ASSERT_LT(field->states().activeCount(), field->probeCount());
  const UpdateByHand hand(scene, *field);
  for (uint64_t u = 0; u < 2; ++u) {
    const FieldSnapshot previous = takeSnapshot(*field);
    const Texels expected = hand.update(u, 0, test::storedTexels(*field), &previous);
    field->update(u, {}, {});
    test::expectTexels(*field, expected);
  }
}

// Above a plate that faces down, probes see less of its back the higher they are. Those that see
// more than their share keep what they had, here nothing; the others are as the formulas say.
TEST_F(BlendStages, ProbesFreezeAboveTheirShareOfBackFaces) {
  test::SceneBuilder builder;
  builder.quad(Vec3f(-1, 0, -1), Vec3f(1, 0, -1), Vec3f(1, 0, 1), Vec3f(-1, 0, 1),
               builder.material(Vec3f(0.5f)));
  builder.scene().sky.radiance = Vec3f(1, 2, 3);
  builder.scene().bounds = {Vec3f(-2), Vec3f(2, 6, 2)};
  const FieldScene scene(builder.finish());
  const ProbeLayout layout = boxLayout({Vec3f(-0.1f, 0.1f, -0.1f), Vec3f(0.1f, 5, 0.1f)},
                                       Vec3i(1, 24, 1), scene.scene.bounds);
  for (const double share : {0.05, 0.1, 0.3}) {
    Params params = exactParams("rtxgi");
    params.rays = 200;
    params.backface_freeze = share;
    const auto field = scene.field(gpu(), layout, params);
    const UpdateByHand hand(scene, *field);
    const Texels expected = hand.update(0, 0, test::storedTexels(*field), nullptr);
    field->update(0, {}, {});
    test::expectTexels(*field, expected);
    const Texels stored = test::storedTexels(*field);
    int frozen = 0;
    for (std::size_t p = 0; p < 24; ++p) frozen += stored.irradiance[p * 36] == Vec3d(0) ? 1 : 0;
    EXPECT_GE(frozen, 1) << share;
    EXPECT_LE(frozen, 20) << share;
  }
}

// 65,536 probes; the first, and every 977th, by hand.
TEST_F(BlendStages, ALatticeOf64By16By64ProbesEqualsTheFormulas) {
  const FieldScene scene(test::randomRoom(3));
  Params params = exactParams("rtxgi");
  params.rays = 4;
  params.irradiance_texels = 4;
  params.moment_texels = 5;
  const auto field = scene.field(gpu(), roomLayout(scene.scene, Vec3i(64, 16, 64)), params,
                                 {.seed = 2, .accumulate = false});
  const UpdateByHand hand(scene, *field);
  constexpr int kStep = 977;
  for (uint64_t u = 0; u < 2; ++u) {
    const FieldSnapshot previous = takeSnapshot(*field);
    const Texels expected = hand.update(u, 0, test::storedTexels(*field), &previous, kStep);
    field->update(u, {}, {});
    test::expectTexels(*field, expected, kStep);
  }
}

// Every border texel repeats the interior texel that the map continues with, to the byte.
TEST_F(BlendStages, BordersRepeatTheTexelsAcrossTheSeam) {
  const FieldScene scene(test::randomRoom(4));
  for (const int side : {3, 4, 8}) {
    Params params = loadParams("rtxgi");
    params.rays = 50;
    params.irradiance_texels = side;
    params.moment_texels = side + 5;
    const auto field = scene.field(gpu(), roomLayout(scene.scene, Vec3i(3, 2, 2)), params);
    runTemporal(*field, 2);
    const std::vector<Vec3f> irradiance = field->irradianceTexels();
    const std::vector<Vec2f> moments = field->momentTexels();
    const auto check = [](const auto& texels, int probe, int n) {
      for (int y = -1; y <= n; ++y)
        for (int x = -1; x <= n; ++x) {
          const int at = probe * (n + 2) * (n + 2) + tileTexel(x, y, n, 1);
          const std::size_t inside = test::storedTexel(probe, tileTexel(x, y, n, 0), n, 1);
          EXPECT_EQ(texels[static_cast<std::size_t>(at)], texels[inside])
              << n << " at " << x << ", " << y;
        }
    };
    for (int p = 0; p < 12; ++p) {
      check(irradiance, p, side - 2);
      check(moments, p, side + 3);
    }
  }
}

struct Bytes {
  std::vector<Vec3f> irradiance;
  std::vector<Vec2f> moments;
  bool operator==(const Bytes&) const = default;
};

// The order of rays in memory and the size of a batch change no byte; nor with moved and inactive
// probes and reduced rays.
TEST_F(BlendStages, RayOrderAndBatchesChangeNoByte) {
  const FieldScene scene(test::randomRoom(6));
  const ProbeLayout layout = roomLayout(scene.scene, Vec3i(5, 3, 3));
  const auto run = [&](const std::string& preset, int order, uint64_t working_set) {
    Params params = loadParams(preset);
    params.rays = 96;
    params.ray_order = order;
    if (preset == "majercik2021") params.flat_ray_share = 0.5, params.flat_contrast = 0.6;
    const auto field =
        scene.field(gpu(), layout, params, {.seed = 1, .working_set_bytes = working_set});
    runTemporal(*field, 3);
    return Bytes{field->irradianceTexels(), field->momentTexels()};
  };
  for (const char* preset : {"probelab", "majercik2021"}) {
    const Bytes one = run(preset, PL_RAYS_BY_PROBE, uint64_t{64} << 20);
    EXPECT_EQ(one, run(preset, PL_RAYS_BY_DIRECTION, uint64_t{64} << 20)) << preset;
    EXPECT_EQ(one, run(preset, PL_RAYS_BY_DIRECTION, 7 * 96 * rayBytes(true))) << preset;
    EXPECT_EQ(one, run(preset, PL_RAYS_BY_PROBE, 1)) << preset;
  }
}

// Without feedback a probe depends on itself alone: switching others off leaves its bytes, and
// theirs stay as they were made.
TEST_F(BlendStages, InactiveProbesAreLeftAloneAndChangeNoOther) {
  const FieldScene scene(test::randomRoom(8));
  const ProbeLayout layout = roomLayout(scene.scene, Vec3i(8, 4, 4));
  Params params = loadParams("rtxgi");
  params.rays = 64;
  params.feedback = 0;
  const auto all = scene.field(gpu(), layout, params);
  params.classification = PL_CLASSIFY_INSIDE;
  const auto some = scene.field(gpu(), layout, params);
  runTemporal(*all, 2);
  runTemporal(*some, 2);
  ASSERT_LT(some->states().activeCount(), some->probeCount());
  const std::vector<Vec3f> a = all->irradianceTexels(), b = some->irradianceTexels();
  const std::vector<Vec2f> c = all->momentTexels(), d = some->momentTexels();
  for (std::size_t i = 0; i < a.size(); ++i)
    ASSERT_EQ(b[i], some->states().active[i / 64] != 0 ? a[i] : Vec3f(0)) << i;
  for (std::size_t i = 0; i < c.size(); ++i)
    ASSERT_EQ(d[i], some->states().active[i / 256] != 0 ? c[i] : Vec2f(0)) << i;
  EXPECT_EQ(some->workOfUpdate().rays, uint64_t{64} * some->states().activeCount());
}

}  // namespace
}  // namespace probelab
