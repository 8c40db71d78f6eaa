// SPDX-License-Identifier: GPL-3.0-or-later
// The known ills of small formats and encodings, each on the case that shows it, and their cures:
// false deviations of fp16 moments, stalls under hysteresis, energy lost by averaging encoded
// samples.
#include <array>
#include <cmath>

#include "update_oracle.h"

namespace probelab {
namespace {

using test::ControlledSky;
using test::exactParams;
using test::FieldScene;
using test::SceneBuilder;

class Storage : public GpuTest {};

// Deviation over mean that the moments of one texel say.
double relativeDeviation(const Vec2d& moments) {
  return std::sqrt(std::abs(moments.x * moments.x - moments.y)) / moments.x;
}

struct FalseDeviation {
  double mean = 0, largest = 0, negative = 0;
};

// One ray a texel: the true deviation is 0. Floor, walls and ceiling lie 0.1 to 1 r_i away.
FalseDeviation measureFalseDeviation(GpuContext& gpu, int encoding) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(10, 8, 9), builder.material(Vec3f(0.5f)), true);
  const FieldScene scene(builder.finish());
  const ProbeLayout layout =
      test::boxLayout({Vec3f(1), Vec3f(9, 7, 8)}, Vec3i(3, 2, 2), scene.scene.bounds);
  Params params = loadParams("rtxgi");
  params.moment_encoding = encoding;
  params.rays = 1;
  params.feedback = 0;
  params.moment_texels = 3;
  const auto field = scene.field(gpu, layout, params);
  FalseDeviation result;
  constexpr int kUpdates = 100;
  for (uint64_t u = 0; u < kUpdates; ++u) {
    field->update(u, {}, {});
    for (int p = 0; p < 12; ++p) {
      const Vec2d moments(field->momentTexels()[static_cast<std::size_t>(p * 9 + 4)]);
      const double deviation = relativeDeviation(moments);
      result.mean += deviation / (12 * kUpdates);
      result.largest = std::max(result.largest, deviation);
      result.negative += moments.y < moments.x * moments.x ? 1.0 / (12 * kUpdates) : 0;
    }
  }
  return result;
}

// Raw halves: the mean square is wrong by up to 2^-11, the mean's square by up to 2^-10; the root
// of their difference is some percent of the distance. Mean and deviation do not have the
// difference.
TEST_F(Storage, CentralMomentsHaveNoFalseDeviation) {
  const FalseDeviation raw = measureFalseDeviation(gpu(), PL_MOMENTS_RAW);
  const FalseDeviation central = measureFalseDeviation(gpu(), PL_MOMENTS_CENTRAL);
  RecordProperty("raw_mean", std::to_string(raw.mean));
  RecordProperty("raw_largest", std::to_string(raw.largest));
  RecordProperty("raw_negative", std::to_string(raw.negative));
  RecordProperty("central_mean", std::to_string(central.mean));
  RecordProperty("central_largest", std::to_string(central.largest));
  // The published numbers: 1.8 % on average, 3.7 % at most, half of the variances negative.
  EXPECT_NEAR(raw.mean, 0.018, 0.003);
  EXPECT_NEAR(raw.largest, 0.037, 0.006);
  EXPECT_NEAR(raw.negative, 0.5, 0.1);
  EXPECT_LT(central.mean, raw.mean / 20);
  EXPECT_LT(central.largest, raw.largest / 20);
}

// A flat wall under the lobe has a deviation of its own: halves must report it as fp32 does.
TEST_F(Storage, CentralMomentsKeepTheDeviationOfAFlatWall) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(4), builder.material(Vec3f(0.5f)), true);
  const FieldScene scene(builder.finish());
  const ProbeLayout layout =
      test::boxLayout({Vec3f(0.3f), Vec3f(3.6f)}, Vec3i(3, 3, 3), scene.scene.bounds);
  const auto moments = [&](int format, int encoding) {
    Params params = exactParams("rtxgi");
    params.moment_format = format;
    params.moment_encoding = encoding;
    params.feedback = 0;
    const auto field = scene.field(gpu(), layout, params);
    field->update(0, {}, {});
    return test::storedTexels(*field).moments;
  };
  const auto exact = moments(PL_FORMAT_RG32F, PL_MOMENTS_RAW);
  const auto raw = moments(PL_FORMAT_RG16F, PL_MOMENTS_RAW);
  const auto central = moments(PL_FORMAT_RG16F, PL_MOMENTS_CENTRAL);
  double raw_error = 0, central_error = 0;
  for (std::size_t i = 0; i < exact.size(); ++i) {
    const double truth = relativeDeviation(exact[i]);
    raw_error += std::pow(relativeDeviation(raw[i]) - truth, 2);
    central_error += std::pow(relativeDeviation(central[i]) - truth, 2);
  }
  const double count = static_cast<double>(exact.size());
  RecordProperty("raw_rms", std::to_string(std::sqrt(raw_error / count)));
  RecordProperty("central_rms", std::to_string(std::sqrt(central_error / count)));
  EXPECT_LT(std::sqrt(central_error), std::sqrt(raw_error) / 20);
}

// Distances of kilometres: they are stored in units of r_i, so no square leaves the format.
TEST_F(Storage, SquaresOfLongDistancesStayInTheFormat) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(9000), builder.material(Vec3f(0.5f), Vec3f(1)), true);
  const FieldScene scene(builder.finish());
  const ProbeLayout layout =
      test::boxLayout({Vec3f(1000), Vec3f(8000)}, Vec3i(3), scene.scene.bounds);
  for (const int encoding : {PL_MOMENTS_RAW, PL_MOMENTS_CENTRAL}) {
    Params params = loadParams("rtxgi");
    params.moment_encoding = encoding;
    params.distance_clamp = 100;
    const auto field = scene.field(gpu(), layout, params);
    field->update(0, {}, {});
    EXPECT_EQ(field->counters().clamped_texels, 0u);
    for (const Vec2f& m : field->momentTexels()) EXPECT_LT(m.y, 10.0f);
  }
}

struct StallCase {
  const char* name;
  int format;
  double gamma;
};
class Stall : public GpuTest, public ::testing::WithParamInterface<StallCase> {
 protected:
  // Linear level reached, over the target: by updates from black under hysteresis 0.97, the mean
  // over the channels, texels and last 100 of 500 updates.
  double reached(int rounding) {
    const ControlledSky sky(Vec3f(0.8f), 0);
    Params params = loadParams("rtxgi");
    params.visibility = 0;
    params.irradiance_format = GetParam().format;
    params.encoding_gamma = GetParam().gamma;
    params.change_detector = PL_CHANGE_NONE;
    params.rounding = rounding;
    const auto field = sky.field(gpu(), params);
    double sum = 0, count = 0;
    for (uint64_t u = 0; u < 500; ++u) {
      field->update(u, {.hysteresis = 0.97f}, {});
      if (u < 400) continue;
      for (const Vec3d& t : test::storedTexels(*field).irradiance)
        for (std::size_t c = 0; c < 3; ++c)
          sum += std::pow(t[c], GetParam().gamma) / (static_cast<double>(0.8f)), ++count;
    }
    return sum / count;
  }
};

// 0.97^400 = 5e-6 of the way is left to exact arithmetic. A step of 0.03 of what is left rounds to
// nothing once it is below half a unit of the format.
TEST_P(Stall, NearestStallsAndDitheringArrives) {
  const double nearest = reached(0), dithered = reached(1);
  RecordProperty("nearest", std::to_string(nearest));
  RecordProperty("dithered", std::to_string(dithered));
  EXPECT_LT(nearest,
            GetParam().format == PL_FORMAT_RGB10A2 && GetParam().gamma == 1 ? 0.985 : 0.93);
  EXPECT_NEAR(dithered, 1, 0.02);
}

INSTANTIATE_TEST_SUITE_P(Formats, Stall,
                         ::testing::Values(StallCase{"R11Gamma5", PL_FORMAT_R11G11B10F, 5},
                                           StallCase{"R11Gamma1", PL_FORMAT_R11G11B10F, 1},
                                           StallCase{"Rgb10Gamma5", PL_FORMAT_RGB10A2, 5},
                                           StallCase{"Rgb10Gamma1", PL_FORMAT_RGB10A2, 1}),
                         [](const auto& info) { return info.param.name; });

TEST_F(Storage, HalvesDoNotStall) {
  const ControlledSky sky(Vec3f(0.8f), 0);
  Params params = loadParams("rtxgi");
  params.visibility = 0;
  params.change_detector = PL_CHANGE_NONE;
  const auto field = sky.field(gpu(), params);
  for (uint64_t u = 0; u < 400; ++u) field->update(u, {.hysteresis = 0.97f}, {});
  // The step vanishes below 2^-12 of the stored value, at 2^-12 / 0.03 = 0.8 % of it, 4 % of L.
  EXPECT_GT(std::pow(test::storedTexels(*field).irradiance.front().x, 5) / 0.8, 0.95);
}

// Uniform radiance 1 +- 0.866, CV 0.5. The encoded average converges to E[L^(1/5)]^5, an integral
// over the interval; the linear one keeps the mean of the very samples.
TEST_F(Storage, LinearHistoryLosesNoEnergy) {
  const double b = std::sqrt(0.75);
  const ControlledSky sky(Vec3f(1), static_cast<float>(b));
  const auto power = [&](double p) {  // mean of L^p over L in [1 - b, 1 + b]
    return (std::pow(1 + b, p + 1) - std::pow(1 - b, p + 1)) / (2 * b * (p + 1));
  };
  const double loss = 1 - std::pow(power(0.2), 5);
  EXPECT_NEAR(loss, 0.4 * 0.25, 0.03);  // 0.4 CV^2, and higher powers of CV = 0.5
  std::array<double, 2> kept{};
  for (const int linear : {0, 1}) {
    Params params = exactParams("rtxgi");
    params.visibility = 0;
    params.change_detector = PL_CHANGE_NONE;
    params.hysteresis_space = linear;
    const auto field = sky.field(gpu(), params);
    double mean = 1, sum = 0, truth = 0;  // `mean`: the same history of the radiance itself
    for (uint64_t u = 0; u < 600; ++u) {
      field->update(u, {.hysteresis = u == 0 ? 0 : 0.97f}, {});
      mean = u == 0 ? sky.radiance(u).x : 0.97 * mean + 0.03 * sky.radiance(u).x;
      if (u < 200) continue;
      sum += std::pow(test::storedTexels(*field).irradiance.front().x, 5);
      truth += mean;
    }
    kept[static_cast<std::size_t>(linear)] = sum / truth;
  }
  RecordProperty("encoded", std::to_string(kept[0]));
  RecordProperty("linear", std::to_string(kept[1]));
  EXPECT_NEAR(kept[0], 1 - loss, 0.015);
  EXPECT_NEAR(kept[1], 1, 1e-4);
}

// The preset that has these cures keeps within the bytes of [GDC19], 6x6 r11g11b10f and 16x16
// rg16f.
TEST_F(Storage, OurPresetFitsTheTalksBytes) {
  EXPECT_EQ(atlasBytesPerProbe(loadParams("gdc2019")), 1168u);
  EXPECT_LE(atlasBytesPerProbe(loadParams("probelab")), 1168u);
}

}  // namespace
}  // namespace probelab
