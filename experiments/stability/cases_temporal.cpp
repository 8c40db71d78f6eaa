// SPDX-License-Identifier: GPL-3.0-or-later
// Updates one after another: history of 0 and 1, formats that stall, energy, the first update.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/interrupt.h"
#include "cases.h"
#include "closed_forms.h"
#include "sky_dial.h"

namespace probelab {
namespace {

// Stored as it is, rounded to nearest, no detector.
Params plainParams(const std::string& format) {
  Params params = formatParams("rtxgi", format);
  params.encoding_gamma = 1;
  params.change_detector = PL_CHANGE_NONE;
  return params;
}

// Without history an update is the last frame; with nothing else, nothing changes.
Measurement hysteresisEnds(Workbench& bench, const CaseVariant&) {
  const SkyDial sky(Vec3f(0.7f), 0.8f);
  const auto field = sky.field(bench, plainParams("rgba32f"));
  const auto fresh = sky.field(bench, plainParams("rgba32f"));
  field->update(3, {}, {});
  field->update(9, {.hysteresis = 0}, {});
  fresh->update(9, {}, {});
  const bool last = field->irradianceTexels() == fresh->irradianceTexels();
  for (uint64_t u = 0; u < 20; ++u) field->update(u, {.hysteresis = 1}, {});
  const bool kept = field->irradianceTexels() == fresh->irradianceTexels();
  const auto black = sky.field(bench, plainParams("rgba32f"));
  black->update(9, {.hysteresis = 1}, {});
  const bool dark = meanRadiance(*black) == 0;
  return checked(last && kept && dark,
                 fmt::format("0: {}; 1: {}, from the start {}", last ? "the last frame" : "not",
                             kept ? "kept" : "changed", dark ? "black" : "not black"));
}

Measurement hysteresisRange(Workbench&, const CaseVariant&) {
  Measurement result = checked(true, "");
  for (const char* bad :
       {"hysteresis=1.5", "hysteresis=-0.1", "hysteresis=nan", "hysteresis=inf"}) {
    Params params = loadParams("rtxgi");
    const Measurement one = refused([&] { setParam(params, bad); }, {"hysteresis"});
    if (one.verdict != Verdict::holds) return one;
    result = one;
  }
  return result;
}

Measurement slowHistory(Workbench& bench, const CaseVariant&) {
  const SkyDial sky(Vec3f(0.5f), 0.9f);
  const auto field = sky.field(bench, plainParams("rgba32f"));
  const uint64_t from = sky.rotationFor(1.8), to = sky.rotationFor(0.2);
  const double start = sky.radiance(from).y, goal = sky.radiance(to).y;
  field->update(from, {}, {});
  double worst = 0;
  for (int n = 1; n <= 500; ++n) {
    throwIfInterrupted();
    field->update(to, {.hysteresis = 0.999f}, {});
    if (n % 100 != 0) continue;
    const double left = (meanRadiance(*field) - goal) / (start - goal);
    worst = larger(worst, std::abs(left / std::pow(static_cast<double>(0.999f), n) - 1));
  }
  return within(worst, 0.01, "off h^n by");
}

// Share of the goal that is missing (the worst channel) after a step from 0.2 to 1 when nothing
// changes any more, or as soon as it is less than `enough`.
double missing(ProbeField& field, const SkyDial& sky, double hysteresis, double enough = 0) {
  const uint64_t from = sky.rotationFor(0.2), to = sky.rotationFor(1);
  const double goal = sky.radiance(to).y;
  field.update(from, {}, {});
  std::vector<Vec3f> before;
  for (int n = 0; n < 4000; ++n) {
    throwIfInterrupted();
    field.update(to, {.hysteresis = static_cast<float>(hysteresis)}, {});
    if (n % 8 != 0) continue;
    std::vector<Vec3f> now = field.irradianceTexels();
    const double gap = 1 - static_cast<double>(minComponent(now.front())) / goal;
    if (gap < enough || now == before) return gap;
    before = std::move(now);
  }
  throw Error("did not come to rest in 4000 updates");
}

Measurement stall(Workbench& bench, const CaseVariant& variant) {
  const SkyDial sky(Vec3f(0.99f), 0.9f);
  const auto field = sky.field(bench, plainParams(variant.format));
  const double goal = sky.radiance(sky.rotationFor(1)).y;
  // A step (1 - h)(goal - x) below half an ulp is lost: it rests at the first number of the format
  // that is not more than (ulp / 2) / (1 - h) below the goal.
  const double ulp = formatUlp(variant.format, 2, 0.75);
  const double at_97 = 1 - missing(*field, sky, 0.97);
  const double rest = ulp * std::ceil((goal - ulp / 2 / 0.03) / ulp) / goal;
  // Half a number for ties; the device's sums, 3 roundings, over 1 - h.
  const double rest_bound = ulp / 2 / goal + 3 * 0x1p-24 / 0.03;
  // To come within 1 % it must leave the last number below 0.99 of the goal.
  const double last = ulp * (std::ceil(0.99 * goal / ulp) - 1);
  const double law = (goal - last) / (ulp / 2);
  constexpr double kAccuracy = 0.05;
  const double history = breakingPoint(
      1.01, 200, [&](double x) { return missing(*field, sky, 1 - 1 / x, 0.01) < 0.01; }, kAccuracy);
  const std::string text = fmt::format(
      "at h 0.97 it reaches {:.4g} (law {:.4g}); 1 / (1 - h) up to {:.3g} arrives (law {:.3g})",
      at_97, rest, history, law);
  if (!(std::abs(at_97 - rest) <= rest_bound)) return checked(false, text);
  if (history >= 200) return checked(law >= 200, text);
  // What was found is the middle of an interval of that width.
  if (!(std::abs(std::log(history / law)) <= kAccuracy / 2 + 1e-3)) return checked(false, text);
  return limitAt(history, text);
}

// Dithered, h 0.97: the mean over texels and 100 updates.
Measurement dithered(Workbench& bench, const CaseVariant& variant) {
  const SkyDial sky(Vec3f(0.9f), 0.9f);
  Params params = plainParams(variant.format);
  params.rounding = 1;
  const auto field = sky.field(bench, params);
  const uint64_t to = sky.rotationFor(1);
  field->update(sky.rotationFor(0.2), {}, {});
  double sum = 0;
  for (int u = 0; u < 500; ++u) {
    throwIfInterrupted();
    field->update(to, {.hysteresis = 0.97f}, {});
    if (u >= 400) sum += meanRadiance(*field, 2) / 100;
  }
  const double goal = sky.radiance(to).z;
  // Rounding adds a variance of at most ulp^2 / 4 an update, history keeps it: ulp^2 / 4 / (1 -
  // h^2) a texel; 36 texels or more and 100 updates, 1.5 of them independent: 4 deviations. Beside
  // them what h^400 has left of the step.
  const double deviation = formatUlp(variant.format, 2, 0.75) / 2 / std::sqrt(1 - 0.97 * 0.97);
  const double bound = 4 * deviation / std::sqrt(36 * 1.5) / goal + std::pow(0.97, 400);
  return within(std::abs(sum / goal - 1), bound, "error");
}

// Mean under history over the mean of the same light, radiance with the coefficient of variation.
double energyShare(Workbench& bench, const std::string& preset, double variation) {
  const SkyDial sky(Vec3f(1), static_cast<float>(variation * std::sqrt(3.0)));
  Params params = exactParams(preset);
  params.change_detector = PL_CHANGE_NONE;
  const auto field = sky.field(bench, params);
  double mean = 0, sum = 0, truth = 0;
  for (uint64_t u = 0; u < 240; ++u) {
    throwIfInterrupted();
    field->update(u, {.hysteresis = u == 0 ? 0.0f : 0.97f}, {});
    mean = u == 0 ? sky.radiance(u).y : 0.97 * mean + 0.03 * sky.radiance(u).y;
    if (u < 80) continue;
    if (u % 4 == 0) sum += meanRadiance(*field), truth += mean;
  }
  return sum / truth;
}

Measurement energy(Workbench& bench, const CaseVariant& variant) {
  if (variant.format == "linear")
    return within(std::abs(energyShare(bench, "probelab", 0.5) - 1), 1e-4, "energy off by");
  const double at_half = energyShare(bench, "rtxgi", 0.5);
  const double variation = breakingPoint(
      0.03, 0.57, [&](double cv) { return energyShare(bench, "rtxgi", cv) >= 0.99; }, 0.1);
  return limitAt(
      variation,
      fmt::format("1 % lost from a variation of {:.3g} on (law 0.158), {:.3g} left at 0.5",
                  variation, at_half));
}

// Updates until 90 % of the light from a black history.
Measurement lightOn(Workbench& bench, const CaseVariant& variant) {
  const SkyDial sky(Vec3f(1), 0);
  const auto updates = [&](bool history) {
    const auto field = sky.field(bench, exactParams(variant.format));
    for (int u = 0; u < 600; ++u) {
      throwIfInterrupted();
      const float h = history || u > 0 ? 0.97f : 0.0f;
      field->update(static_cast<uint64_t>(u), {.hysteresis = h}, {});
      if (meanRadiance(*field) >= 0.9) return u + 1;
    }
    return 601;
  };
  const int fresh = updates(false), black = updates(true);
  const std::string text =
      fmt::format("{} updates in a new field, {} after a black one", fresh, black);
  if (fresh != 1) return checked(false, text);
  return black == 1 ? checked(true, text) : limitAt(black, text);
}

// A black texel takes its first update in full, noise and all: what is left of it after n updates is
// h^n of its error. The light is dim and even enough that no detector sees a change in it.
Measurement firstNoise(Workbench& bench, const CaseVariant&) {
  const SkyDial sky(Vec3f(0.05f), 0.8f);
  Params params = exactParams("rtxgi");
  params.encoding_gamma = 1;
  params.darkening_step = 0;
  const auto field = sky.field(bench, params);
  const uint64_t start = sky.rotationFor(1.7);
  const double first = sky.radiance(start).y;
  double expected = first, worst = 0;
  for (uint64_t u = 0; u < 200; ++u) {
    field->update(start + u, {.hysteresis = 0.97f}, {});
    if (u > 0) expected = 0.97 * expected + 0.03 * sky.radiance(start + u).y;
    worst = larger(worst, std::abs(meanRadiance(*field) / expected - 1));
  }
  // Each update rounds three times by 2^-24; of an older one's roundings h^n is left.
  const Measurement off = within(worst, 3 * 0x1p-24 / 0.03 + 1e-6, "off the recursion by");
  return both(checked(first > 1.5 * static_cast<double>(0.05f),
                      fmt::format("the first update brings {:.3g} of the mean", first / 0.05)),
              off);
}

// Noise darkens by at least one step of the stored value and brightens by 1 - h of the difference.
// Returns what is left of the mean; `worst` gets the error against the same recursion in double.
double keptByDarkening(Workbench& bench, double radiance, double& worst) {
  const SkyDial sky(Vec3f(static_cast<float>(radiance)), 0.5f);
  Params params = exactParams("rtxgi");
  params.change_threshold = params.brightness_threshold = 100;  // none but the step
  const auto field = sky.field(bench, params);
  const double gamma = params.encoding_gamma, h = static_cast<double>(0.97f);
  // Of what is stored half as bright there.
  const double least = params.darkening_step * std::pow(2.0, 1 / gamma);
  double stored = 0, sum = 0, truth = 0;
  constexpr int kUpdates = 400, kSettling = 200;
  for (uint64_t u = 0; u < kUpdates; ++u) {
    throwIfInterrupted();
    field->update(u, {.hysteresis = 0.97f}, {});
    const double sample = sky.radiance(u).y, step = std::pow(sample, 1 / gamma) - stored;
    const double mixed = u == 0 ? step : (1 - h) * step;
    stored += step < 0 ? std::max(step, std::min(mixed, -least)) : mixed;
    if (u < kSettling) continue;
    const double mean = meanRadiance(*field);
    worst = larger(worst, std::abs(mean / std::pow(stored, gamma) - 1));
    sum += mean, truth += sample;
  }
  return sum / truth;
}

Measurement darkeningStep(Workbench& bench, const CaseVariant&) {
  double worst = 0;
  const auto kept = [&](double radiance) { return keptByDarkening(bench, radiance, worst); };
  // Fifth roots alone lose 0.4 CV^2 = 3 % of this noise.
  const double one_over = breakingPoint(
      0.01, 1e4, [&](double x) { return kept(1 / x) >= 0.9; }, 0.1);
  const double dim = kept(1e-4);
  // Three roundings an update, over 1 - h, five times in the fifth power.
  return both(within(worst, 5 * 3 * 0x1p-24 / 0.03, "off the recursion by"),
              limitAt(1 / one_over,
                      fmt::format("10 % lost below a radiance of {:.2g}, {:.2g} left at 1e-4",
                                  1 / one_over, dim)));
}

// L' = h L + (1 - h) (Le + rho L): updates until 99 % of the end.
Measurement slowestMode(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.5f, 1));
  Params params = plainParams("rgba32f");
  params.rays = 16;
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params, variant);
  field->update(0, {}, {});
  int expected = 1, measured = 0;
  for (double radiance = 1; radiance < 1.98; ++expected)
    radiance = 0.97 * radiance + 0.03 * (1 + 0.5 * radiance);
  for (int u = 2; u <= expected + 3 && measured == 0; ++u) {
    throwIfInterrupted();
    field->update(0, {.hysteresis = 0.97f}, {});
    if (u >= expected - 3 && meanRadiance(*field) >= 1.98) measured = u;
  }
  return checked(std::abs(measured - expected) <= 1,
                 fmt::format("{} updates, by the recursion {}", measured, expected));
}

// A new field is black whatever memory held, and its first updates depend on nothing else.
Measurement firstUpdate(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0.5f), Vec3f(0.2f, 0.5f, 1)), true);
  builder.pointLight(Vec3f(0.4f, 1.5f, 1), Vec3f(2));
  const BuiltScene scene(builder.finish());
  Params params = exactParams("rtxgi");
  params.rays = 32;
  std::vector<Vec3f> texels[2];
  bool black = true;
  for (auto& after : texels) {
    const auto field = bench.field(scene, furnaceLayout(scene.scene, 3), params, variant);
    for (const Vec3f& t : field->irradianceTexels()) black = black && t == Vec3f(0);
    runTemporal(*field, 2);
    after = field->irradianceTexels();
  }
  return checked(black && texels[0] == texels[1],
                 fmt::format("{} at first, then {}", black ? "black" : "not black",
                             texels[0] == texels[1] ? "the same bits" : "different"));
}

}  // namespace

std::vector<StabilityCase> temporalCases() {
  const auto tracers = bothTracers();
  return {
      {"temporal.hysteresis_ends",
       "hysteresis 0 and 1",
       "0: the last frame, bit for bit; 1: what was there before, at first black",
       "G31",
       {},
       hysteresisEnds},
      {"temporal.hysteresis_range",
       "hysteresis outside 0 to 1, NaN",
       "error naming the key",
       "G31",
       {},
       hysteresisRange},
      {"temporal.slow_history",
       "light switched under hysteresis 0.999",
       "h^n of the step is left after n updates, within 1 %",
       "G32",
       {},
       slowHistory},
      {"temporal.stall", "light rises from 0.2 to 1, nearest rounding",
       "rests (ulp / 2) / (1 - h) below, on the format's grid; less than 1 % missing up to h = "
       "0.995",
       "G33 P5", irradianceFormats(), stall},
      {"temporal.dithered", "the same at h = 0.97, dithered",
       "arrives: 4 deviations of the dither's noise", "G33 P5", irradianceFormats(), dithered},
      {"temporal.energy",
       "noisy light under hysteresis 0.97",
       "keeps its mean; averages of fifth roots lose 0.4 CV^2",
       "P4",
       {{"", "linear"}, {"", "rtxgi"}},
       energy},
      {"temporal.light_on",
       "light comes on over a black field",
       "90 % after 1 update",
       "G34",
       {{"", "classic"}, {"", "rtxgi"}, {"", "majercik2021"}, {"", "probelab"}},
       lightOn},
      {"temporal.first_noise", "a noisy light comes on over a black field",
       "first x_0, then L' = h L + (1 - h) x_n within roundings", "G34", {}, firstNoise},
      {"temporal.darkening_step",
       "dim noisy light, rtxgi's least step towards dark",
       "keeps its mean; follows the preset's own recursion within roundings",
       "P4",
       {},
       darkeningStep},
      {"temporal.slowest_mode", "bounces under hysteresis 0.97, albedo 0.5",
       "99 % after as many updates as L' = h L + (1 - h)(Le + rho L) takes, +-1", "G18 P2", tracers,
       slowestMode},
      {"temporal.first_update", "the first updates of a new field",
       "black before, the same bits in a second one", "G34 P20", tracers, firstUpdate},
  };
}

}  // namespace probelab
