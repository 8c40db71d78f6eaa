// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance texels written from outside: what is stored, and that queries read it.
#include <limits>

#include "base/error.h"
#include "ddgi/snapshot.h"
#include "ddgi/texels.h"
#include "scattered_helpers.h"
#include "update_oracle.h"

namespace probelab {
namespace {

using test::exactParams;
using test::FieldScene;

class SetTexels : public GpuMemoryModeTest {};
INSTANTIATE_TEST_SUITE_P(Memory, SetTexels, ::testing::Bool(), memoryModeName);

const Vec3i kPoints(3, 2, 2);

FieldScene room() { return FieldScene(test::furnaceScene(0.5f, 1.0f)); }

std::unique_ptr<ProbeField> makeField(GpuContext& gpu, const FieldScene& scene,
                                      const Params& params) {
  auto field = scene.field(
      gpu, test::boxLayout({Vec3f(0.3f), Vec3f(1.7f)}, kPoints, scene.scene.bounds), params);
  field->update(0, {}, {});
  return field;
}

TEST_P(SetTexels, QueriesReadThem) {
  const FieldScene scene = room();
  for (const char* border : {"border=true", "border=false"}) {
    Params params = exactParams("rtxgi");
    setParam(params, border);
    const auto field = makeField(gpu(), scene, params);
    FieldSnapshot wanted = takeSnapshot(*field);
    Rng rng(3, RngStream::test, 1);
    for (Vec3f& texel : wanted.irradiance)
      texel = Vec3f(rng.nextFloat(), rng.nextFloat(), rng.nextFloat());
    field->setIrradianceTexels(wanted.irradiance);
    EXPECT_EQ(field->irradianceTexels(), wanted.irradiance);
    EXPECT_EQ(field->momentTexels(), wanted.moments);
    const auto points = test::randomQueries({Vec3f(0.1f), Vec3f(1.9f)}, 500, 4);
    const std::vector<Vec4f> device = field->query(points);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto host = querySnapshot<double>(wanted, wanted.params, points[i]);
      const Vec3d got(Vec3f(device[i].x, device[i].y, device[i].z));
      EXPECT_LT(length(got - host.irradiance), 1e-4 * std::numbers::pi);  // of the largest tap
    }
    EXPECT_EQ(field->counters().clamped_texels, 0u);
    field->update(1, {}, {});  // without hysteresis it forgets them
    EXPECT_NE(field->irradianceTexels(), wanted.irradiance);
  }
}

// What each format keeps of 0.3, its largest number and more; from its number of mantissa bits.
TEST_P(SetTexels, FormatsRoundToNearestAndCountWhatTheyClamp) {
  struct Case {
    const char* format;
    Vec3d rounding, largest;
  };
  const double half = 65504, small = 65024, blue = 64512;
  const Case cases[] = {{"rgba16f", Vec3d(0x1p-11), Vec3d(half)},
                        {"r11g11b10f", Vec3d(0x1p-7, 0x1p-7, 0x1p-6), Vec3d(small, small, blue)},
                        {"rgb10a2", Vec3d(1 / 0.3 / 2046), Vec3d(1)}};
  const FieldScene scene = room();
  for (const Case& c : cases) {
    Params params = loadParams("rtxgi");
    setParam(params, std::string("irradiance_format=") + c.format);
    const auto field = makeField(gpu(), scene, params);
    std::vector<Vec3f> texels(field->irradianceTexels().size(), Vec3f(0.3f));
    texels[5] = Vec3f(1e6f);
    texels[6] = Vec3f(0);
    const uint32_t before = field->counters().clamped_texels;
    field->setIrradianceTexels(texels);
    const std::vector<Vec3f> stored = field->irradianceTexels();
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(static_cast<double>(stored[0][i]) / 0.3, 1, c.rounding[i] * 1.000001) << c.format;
      EXPECT_EQ(static_cast<double>(stored[5][i]), c.largest[i]) << c.format;
      EXPECT_EQ(stored[6][i], 0) << c.format;
    }
    EXPECT_EQ(field->counters().clamped_texels, before + 1) << c.format;
    // What is stored already comes back bit for bit.
    field->setIrradianceTexels(stored);
    EXPECT_EQ(field->irradianceTexels(), stored) << c.format;
  }
}

TEST_P(SetTexels, BadNumbersAreRefused) {
  const FieldScene scene = room();
  const auto field = makeField(gpu(), scene, exactParams("rtxgi"));
  const std::vector<Vec3f> good = field->irradianceTexels();
  for (const float bad :
       {-1e-3f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    std::vector<Vec3f> texels = good;
    texels[150].y = bad;  // 64 stored texels a probe
    try {
      field->setIrradianceTexels(texels);
      FAIL();
    } catch (const NumericalError& error) {
      EXPECT_NE(std::string(error.what()).find("probe 2 "), std::string::npos) << error.what();
    }
  }
  EXPECT_EQ(field->irradianceTexels(), good);
}

}  // namespace
}  // namespace probelab
