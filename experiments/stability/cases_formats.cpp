// SPDX-License-Identifier: GPL-3.0-or-later
// Storage formats at their ends: rounding, overflow, numbers that they do not have.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "base/rng.h"
#include "cases.h"
#include "closed_forms.h"
#include "ddgi/texels.h"

namespace probelab {
namespace {

using std::numbers::pi;

Vec3f stored(int format, const Vec3f& value) {
  uint32_t words[4];
  packIrradiance(format, value, words);
  return unpackIrradiance(format, words);
}

// Numbers over the whole range: nearest, so within half an ulp; and kept when stored again.
Measurement rounding(Workbench&, const CaseVariant& variant) {
  const int format = formatOf(variant.format);
  Rng rng(6, RngStream::stability);
  const double high = std::min(formatLargest(variant.format), 1e30);
  const double low = variant.format == "rgba32f" ? 1e-30 : 1e-6;
  double worst = 0;
  bool kept = true;
  for (int i = 0; i < 100000; ++i) {
    const auto value =
        static_cast<float>(low * std::pow(high / low, rng.nextDouble()) * (1 - 0x1p-12));
    const Vec3f once = stored(format, Vec3f(value));
    kept = kept && stored(format, once) == once;
    for (std::size_t c = 0; c < 3; ++c)
      worst = larger(worst, std::abs(static_cast<double>(once[c]) - static_cast<double>(value)) /
                                formatUlp(variant.format, c, static_cast<double>(value)));
  }
  // 1/1023 is not a binary fraction: the unorm's products are rounded to fp32 as well.
  return both(within(worst, 0.5 + 1e-3, "ulp:"),
              checked(kept, kept ? "storing again changes nothing" : "storing again changes it"));
}

// The GPU's image stores truncate 0.3 to 0.29980 and 0.7499 to 0.742 and 0.734; ours round.
Measurement truncation(Workbench&, const CaseVariant& variant) {
  const bool half = variant.format == "rgba16f";
  const float value = half ? 0.3f : 0.7499f;
  const Vec3f s = stored(formatOf(variant.format), Vec3f(value));
  const double wanted[3] = {half ? 0.300048828125 : 0.75, half ? 0.300048828125 : 0.75,
                            half ? 0.300048828125 : 0.75};
  double worst = 0;
  for (std::size_t c = 0; c < 3; ++c)
    worst = larger(worst, std::abs(static_cast<double>(s[c]) - wanted[c]));
  return within(worst, 0,
                fmt::format("{:g} is stored as {:g}; off the nearest by",
                            static_cast<double>(value), static_cast<double>(s.x)));
}

// Brighter than the format on the device: its largest number, counted, finite.
Measurement overflow(Workbench& bench, const CaseVariant& variant) {
  const double largest = formatLargest(variant.format);
  const BuiltScene scene(furnace(0, static_cast<float>(largest * 1.5)));
  Params params = formatParams("classic", variant.format);
  params.rays = 32;
  params.encoding_gamma = 1;
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params);
  field->update(0, {}, {});
  // Red and green of r11g11b10f go to 65024, blue ends before.
  const double green = variant.format == "r11g11b10f" ? 65024 : largest;
  const Vec3f full(static_cast<float>(green), static_cast<float>(green),
                   static_cast<float>(largest));
  const bool all = std::ranges::all_of(field->irradianceTexels(),
                                       [&](const Vec3f& texel) { return texel == full; });
  return both(within(worstError(field->query(furnacePoints()), pi * green), 1e-5, "error"),
              checked(all && field->counters().clamped_texels > 0,
                      fmt::format("{} texels counted, {} at the largest numbers",
                                  field->counters().clamped_texels, all ? "all" : "not all")));
}

// NaN, Inf and negative values never reach a texel.
Measurement notStored(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0, 0.5f));
  Params params = formatParams("classic", variant.format);
  params.rays = 32;
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params);
  field->update(0, {}, {});
  const std::vector<Vec3f> before = field->irradianceTexels();
  int refusals = 0;
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(),
                       std::numeric_limits<float>::infinity(), -1.0f};
  for (const float value : bad) {
    std::vector<Vec3f> texels = before;
    texels[17].y = value;
    try {
      field->setIrradianceTexels(texels);
    } catch (const NumericalError&) {
      ++refusals;
    }
  }
  return checked(refusals == 3 && field->irradianceTexels() == before,
                 fmt::format("{} of 3 refused, texels {}", refusals,
                             field->irradianceTexels() == before ? "unchanged" : "changed"));
}

// Emission that is infinite or NaN, in the code's own scene: no file can hold it.
Measurement poisonedRays(Workbench& bench, const CaseVariant& variant) {
  int named = 0, black = 0;
  for (const float bad :
       {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    SceneBuilder builder;
    builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0.5f), Vec3f(1, bad, 1)), true);
    const BuiltScene scene(builder.finish());
    const auto field =
        bench.field(scene, furnaceLayout(scene.scene), exactParams("rtxgi"), variant);
    try {
      field->update(0, {}, {});
    } catch (const NumericalError& error) {
      if (std::string(error.what()).starts_with("resolve:")) ++named;
    }
    const std::vector<Vec3f> texels = field->irradianceTexels();
    if (std::ranges::all_of(texels, [](const Vec3f& t) { return t == Vec3f(0); })) ++black;
  }
  return checked(named == 2 && black == 2,
                 fmt::format("{} of 2 end with an error that names the stage, {} with black texels",
                             named, black));
}

// Distances far beyond the root of fp16's largest number, 256 m.
Measurement farDistances(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.5f, 1, 5000));
  Params params = exactParams("rtxgi");
  params.rays = 64;
  setParam(params, "moment_format=" + variant.format);
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params);
  convergeField(*field, {.average = 2});
  double largest = 0;
  for (const Vec2f& m : field->momentTexels())
    largest = larger(larger(largest, static_cast<double>(m.x)), static_cast<double>(m.y));
  return both(checked(largest <= 2.25 * 1.001, fmt::format("largest moment {:.3g}", largest)),
              within(worstError(field->query(furnacePoints(5000)), pi / 0.5), 2e-4, "E off by"));
}

}  // namespace

std::vector<StabilityCase> formatCases() {
  return {
      {"formats.rounding", "100,000 numbers over the format's range",
       "nearest: half an ulp; storing again changes nothing", "G40 G42", irradianceFormats(),
       rounding},
      {"formats.truncation",
       "0.3 and 0.7499, which image stores truncate",
       "the nearest numbers: 0.30005, 0.75",
       "G40 G42",
       {{"", "rgba16f"}, {"", "r11g11b10f"}},
       truncation},
      {"formats.overflow",
       "radiance beyond the format's largest number",
       "its largest number, counted, finite",
       "G40 G42 G43",
       {{"", "rgba16f"}, {"", "r11g11b10f"}, {"", "rgb10a2"}},
       overflow},
      {"formats.not_stored", "NaN, infinite and negative texels", "refused; texels unchanged",
       "G42 G43", irradianceFormats(), notStored},
      {"formats.poisoned_rays", "infinite or NaN emission",
       "error naming the stage, texels as before it", "P8", bothTracers(), poisonedRays},
      {"formats.far_distances",
       "a room of 5 km: squares beyond fp16's 65,504",
       "distances in r_i: at most the clamp squared, 2.25; E within 2e-4",
       "G40 P6",
       {{"", "rg32f"}, {"", "rg16f"}},
       farDistances},
  };
}

}  // namespace probelab
