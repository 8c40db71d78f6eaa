// SPDX-License-Identifier: GPL-3.0-or-later
// Very bright, very dark, very small: contrast that formats hold, emitters that rays hardly find.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/interrupt.h"
#include "cases.h"
#include "closed_forms.h"
#include "ddgi/texels.h"
#include "shared/octahedral.h"

namespace probelab {
namespace {

using std::numbers::pi;

constexpr int kDecades = 13;  // 1e-6 to 1e6

// Largest relative error of blue in [x, 1.05 x) after packing, over half an ulp of a normal number.
double packedError(int format, const std::string& name, double x) {
  const double allowed = name == "rgb10a2" ? 0x1p-7 : formatUlp(name, 2, 1) / 2;
  double worst = 0;
  for (int i = 0; i < 256; ++i) {
    const float value = static_cast<float>(x * (1 + 0.05 * i / 256));
    uint32_t words[4];
    packIrradiance(format, Vec3f(value), words);
    const double back = static_cast<double>(unpackIrradiance(format, words).z);
    worst = larger(worst, std::abs(back / static_cast<double>(value) - 1));
  }
  return worst / allowed;
}

// Boxes in a row, each with its probe and its own emission, a decade apart; the field in a format
// must hold what the format's arithmetic on the host makes of each.
double deviceAgainstHost(Workbench& bench, const std::string& name, int format) {
  SceneBuilder builder;
  for (int k = 0; k < kDecades; ++k)
    builder.box(Vec3f(2.0f * static_cast<float>(k) - 0.5f, -0.5f, -0.5f),
                Vec3f(2.0f * static_cast<float>(k) + 0.5f, 0.5f, 0.5f),
                builder.material(Vec3f(0), Vec3f(static_cast<float>(std::pow(10, k - 6)))), true);
  builder.scene().bounds = {Vec3f(-1), Vec3f(25, 1, 1)};
  const BuiltScene scene(builder.finish());
  Params params = formatParams("classic", name);
  params.rays = 32;
  params.encoding_gamma = 1;
  const auto field = bench.field(scene,
                                 fullLattice({Vec3f(0, -0.25f, -0.25f), Vec3f(24, 0.25f, 0.25f)},
                                             Vec3i(kDecades, 1, 1), scene.scene.bounds),
                                 params);
  field->update(0, {}, {});
  const std::vector<Vec3f> texels = field->irradianceTexels();
  const std::size_t per_probe = texels.size() / kDecades;
  double worst = 0;
  for (int k = 0; k < kDecades; ++k) {
    uint32_t words[4];
    packIrradiance(format, Vec3f(static_cast<float>(std::pow(10, k - 6))), words);
    const double expected = static_cast<double>(unpackIrradiance(format, words).y);
    const double stored = static_cast<double>(texels[per_probe * static_cast<std::size_t>(k)].y);
    const double ulp = formatUlp(name, 1, std::max(expected, 1e-38));
    worst = larger(worst, std::abs(stored - expected) / (ulp + 1e-6 * expected));
  }
  return worst;
}

Measurement contrast(Workbench& bench, const CaseVariant& variant) {
  const int format = formatOf(variant.format);
  // 1: sums of 32 rays may round to the next number.
  const Measurement device =
      within(deviceAgainstHost(bench, variant.format, format), 1, "device against host, ulp:");
  if (device.verdict != Verdict::holds) return device;
  const auto fine = [&](double x) { return packedError(format, variant.format, x) <= 1.001; };
  const double start = variant.format == "rgb10a2" ? 0.25 : 1;
  const double high = breakingPoint(start, 1e6, fine, 0.01);
  const double low = 1 / breakingPoint(
                             1 / start, 1e6, [&](double x) { return fine(1 / x); }, 0.01);
  const std::string text = fmt::format("{:.2g} to {:.2g}", low, high);
  if (low <= 1.01e-6 && high >= 0.99e6) return checked(true, text + "; " + device.text);
  return limitAt(high / low, fmt::format("{}, a contrast of {:.2g}", text, high / low));
}

// A square of side a, 1 m above the point, of equal flux whatever its size.
Scene lampScene(float side) {
  SceneBuilder builder;
  const float h = side / 2;
  const uint32_t m = builder.material(Vec3f(0), Vec3f(1 / (side * side)));
  builder.quad(Vec3f(-h, 1, -h), Vec3f(h, 1, -h), Vec3f(h, 1, h), Vec3f(-h, 1, h), m);
  builder.scene().bounds = {Vec3f(-0.5f), Vec3f(0.5f)};
  return builder.finish();
}

double lampTruth(float side, const Vec3d& normal) {
  const double h = static_cast<double>(side) / 2;
  const Vec3d corners[] = {{-h, 1, -h}, {h, 1, -h}, {h, 1, h}, {-h, 1, h}};
  return polygonIrradiance(corners, Vec3d(), normal) /
         (static_cast<double>(side) * static_cast<double>(side));
}

Measurement smallEmitter(Workbench& bench, const CaseVariant&) {
  Measurement result;
  for (const float side : {1.0f, 0.01f}) {
    const BuiltScene scene(lampScene(side));
    const std::vector<QueryPoint> point{upAt(Vec3f(0))};
    const Measurement one =
        near(answersAt(bench, scene, {}, {}, point, {"reference", ""}, {.samples = 1024}),
             std::vector<double>{lampTruth(side, Vec3d(0, 1, 0))}, 0);
    result = side == 1 ? one : both(result, one);
  }
  return result;
}

// Mean of the texel that looks up most, over updates of turned rays, against the polygon's
// irradiance for its own direction; standard errors from the spread of the updates.
Measurement fireflies(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(lampScene(0.1f));
  Params params = exactParams("probelab");
  params.rays = 256;
  const auto field = bench.field(
      scene, fullLattice(scene.scene.bounds, Vec3i(1, 1, 1), scene.scene.bounds), params, variant);
  const int n = atlasSides(params).irradiance;
  int texel = 0;
  for (int t = 0; t < n * n; ++t)
    if (texelDirection<double>(t % n, t / n, n).y >
        texelDirection<double>(texel % n, texel / n, n).y)
      texel = t;
  constexpr int kUpdates = 200;
  double sum = 0, squares = 0, most = 0;
  for (uint64_t u = 0; u < kUpdates; ++u) {
    throwIfInterrupted();
    field->update(u, {}, {});
    const double e =
        pi * static_cast<double>(field->irradianceTexels()[static_cast<std::size_t>(texel)].y);
    sum += e, squares += e * e, most = larger(most, e);
  }
  const double mean = sum / kUpdates;
  const double error = std::sqrt((squares / kUpdates - mean * mean) / (kUpdates - 1));
  const double truth = lampTruth(0.1f, texelDirection<double>(texel % n, texel / n, n));
  return {std::abs(mean - truth) <= 5 * error ? Verdict::holds : Verdict::fails,
          fmt::format("{:.2f} standard errors, updates of up to {:.2g} x the mean",
                      std::abs(mean - truth) / error, most / truth),
          std::nullopt};
}

}  // namespace

std::vector<StabilityCase> brightnessCases() {
  return {
      {"lighting.contrast", "radiance 1e-6 to 1e6 in one field",
       "relative error at most half an ulp of a normal number; the device stores what the host "
       "does",
       "G15", irradianceFormats(), contrast},
      {"lighting.small_emitter",
       "emitters of 1 m2 and 1e-4 m2 of equal flux",
       "Lambert's polygon formula within 5 standard errors",
       "G16",
       {{"reference", ""}},
       smallEmitter},
      {"lighting.fireflies", "a lamp of 0.1 m, found by few rays",
       "no clamp: the mean over updates is the polygon's irradiance within 5 standard errors",
       "G16 P22", bothTracers(), fireflies},
  };
}

}  // namespace probelab
