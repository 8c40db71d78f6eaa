// SPDX-License-Identifier: GPL-3.0-or-later
// The published change detectors at lights that switch, dim and flicker, against the formulas.
#include <cmath>

#include "update_oracle.h"

namespace probelab {
namespace {

using test::ControlledSky;
using test::exactParams;

class ChangeDetection : public GpuTest {};

Params skyParams(int detector) {
  Params params = exactParams("rtxgi");
  params.visibility = 0;
  params.irradiance_texels = 4;
  params.change_detector = detector;
  return params;
}

Vec3d firstTexel(ProbeField& field) { return test::storedTexels(field).irradiance.front(); }

// Which rules a history met.
struct Branches {
  int kept = 0, dropped = 0, reset = 0, brightened = 0;
};

// What the published rules say of one step; for counting only.
void countBranches(const Params& params, const Vec3d& before, const Vec3d& after, Branches& seen) {
  const double half = std::pow(0.5, 1 / params.encoding_gamma);
  if (params.change_detector == PL_CHANGE_M21) {
    double most = 0;
    for (std::size_t c = 0; c < 3; ++c)
      most = std::max(most, std::abs(after[c] - before[c]) / std::max(after[c], before[c]));
    (most > params.reset_threshold ? seen.reset
                                   : (most > params.change_threshold ? seen.dropped : seen.kept))++;
    return;
  }
  const Vec3d darker = (before - after) * half;
  if (maxComponent(darker) > params.change_threshold)
    ++seen.dropped;
  else if (-dot(darker, Vec3d(0.2126, 0.7152, 0.0722)) > params.brightness_threshold)
    ++seen.brightened;
  else
    ++seen.kept;
}

// A light that jumps up, down, nearly stays and halves; every texel follows the formulas from its
// own stored value, in the encodings of the presets.
TEST_F(ChangeDetection, EveryBranchEqualsTheFormulas) {
  const Vec3f a(0.9f, 0.6f, 1.3f);
  const ControlledSky sky(a, 1);
  constexpr double kHysteresis = 0.6;
  for (const int detector : {PL_CHANGE_RTXGI, PL_CHANGE_M21})
    for (const double gamma : {1.0, 5.0}) {
      Params params = skyParams(detector);
      params.encoding_gamma = gamma;
      params.change_threshold = gamma == 1.0 ? 0.25 : 0.1;
      params.reset_threshold = gamma == 1.0 ? 0.8 : 0.3;
      params.change_drop = 0.5;
      const auto field = sky.field(gpu(), params);
      field->update(sky.rotationFor(1.5), {}, {});
      Branches seen;
      for (int u = 0; u < 40; ++u) {
        const Vec3d before = firstTexel(*field);
        const double level = std::pow(before.x, gamma) / static_cast<double>(a.x);
        const double goals[] = {1.95, 0.95 * level, 0.5 * level, 0.05, 1.2 * level};
        const uint64_t rotation = sky.rotationFor(goals[u % 5]);
        const Vec3d after = pow(sky.radiance(rotation), Vec3d(1 / gamma));
        countBranches(params, before, after, seen);
        const Vec3d expected = test::mixByHand(
            params, static_cast<double>(static_cast<float>(kHysteresis)), before, after);
        field->update(rotation, {.hysteresis = static_cast<float>(kHysteresis)}, {});
        const test::Texels stored = test::storedTexels(*field);
        for (const Vec3d& texel : stored.irradiance)
          ASSERT_LT(length(texel - expected), 1e-5) << "update " << u << " gamma " << gamma;
      }
      const bool rtxgi = detector == PL_CHANGE_RTXGI;
      EXPECT_GE(seen.kept, 2) << detector << " gamma " << gamma;
      EXPECT_GE(seen.dropped, 2) << detector << " gamma " << gamma;
      EXPECT_GE(rtxgi ? seen.brightened : seen.reset, 2) << detector << " gamma " << gamma;
    }
}

int updatesUntil(ProbeField& field, uint64_t rotation, int most, const auto& done) {
  for (int u = 1; u <= most; ++u) {
    field.update(rotation, {.hysteresis = 0.97f}, {});
    if (done(firstTexel(field))) return u;
  }
  return most + 1;
}

// A light that goes from 1 to 1/50. Plain history needs ln(0.1) / ln(0.97) = 76 updates to be
// within a tenth of the way in the stored value; both detectors are there in a few.
TEST_F(ChangeDetection, ALampThatIsSwitchedOffGoesDarkSoon) {
  const ControlledSky sky(Vec3f(0.5f), 1);
  const uint64_t bright = sky.rotationFor(1.9), dark = sky.rotationFor(0.04);
  const auto updates = [&](int detector) {
    Params params = skyParams(detector);
    const auto field = sky.field(gpu(), params);
    field->update(bright, {}, {});
    const double from = firstTexel(*field).x;
    const double to = std::pow(sky.radiance(dark).x, 0.2);
    return updatesUntil(*field, dark, 200,
                        [&](const Vec3d& t) { return t.x < to + 0.1 * (from - to); });
  };
  EXPECT_EQ(updates(PL_CHANGE_NONE), 76);
  // h = 0.22 while the stored value is more than 0.25 above, then at least 1/1024 a step.
  EXPECT_LT(updates(PL_CHANGE_RTXGI), 40);
  // In the encoding of gamma 5 the fiftieth part is 0.46 of the value: 0.54 is above 0.25.
  EXPECT_LT(updates(PL_CHANGE_M21), 40);
}

// While it darkens, a texel moves at least darkening_step in [RTXGI]'s storage, and never beyond
// its goal: the last steps are equal, then it stands still.
TEST_F(ChangeDetection, DarkeningEndsExactlyAtTheGoal) {
  const ControlledSky sky(Vec3f(0.5f), 1);
  const uint64_t bright = sky.rotationFor(1.2), dark = sky.rotationFor(1);
  Params params = skyParams(PL_CHANGE_RTXGI);
  const auto field = sky.field(gpu(), params);
  field->update(bright, {}, {});
  const double goal = std::pow(sky.radiance(dark).x, 0.2);
  const double least = std::pow(2.0, 0.2) / 1024;
  double before = firstTexel(*field).x;
  const int most = static_cast<int>(std::ceil((before - goal) / least)) + 1;
  for (int u = 0; u < most; ++u) {
    field->update(dark, {.hysteresis = 0.97f}, {});
    const double now = firstTexel(*field).x;
    EXPECT_GE(now, goal - 1e-6);
    EXPECT_GE(before - now, std::min(least, before - goal) - 1e-6);
    before = now;
  }
  EXPECT_NEAR(before, goal, 1e-6);
}

// Detectors are for the irradiance; the moments keep their plain history.
TEST_F(ChangeDetection, MomentsAreNotChanged) {
  const test::FieldScene scene(test::randomRoom(20));
  const ProbeLayout layout =
      test::boxLayout({Vec3f(0.2f), Vec3f(3.8f, 1.8f, 1.8f)}, Vec3i(3, 2, 2), scene.scene.bounds);
  std::vector<std::vector<Vec2f>> moments;
  for (const int detector : {PL_CHANGE_NONE, PL_CHANGE_RTXGI, PL_CHANGE_M21}) {
    Params params = exactParams("rtxgi");
    params.rays = 40;
    params.change_detector = detector;
    const auto field = scene.field(gpu(), layout, params);
    runTemporal(*field, 3);
    moments.push_back(field->momentTexels());
  }
  EXPECT_EQ(moments[0], moments[1]);
  EXPECT_EQ(moments[0], moments[2]);
}

}  // namespace
}  // namespace probelab
