// SPDX-License-Identifier: GPL-3.0-or-later
// Furnaces, albedos from 0 to 1, lamps in odd places, no light at all, walls outside the lattice.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cases.h"
#include "closed_forms.h"
#include "hostile_files.h"
#include "scene/load.h"

namespace probelab {
namespace {

constexpr double kPi = std::numbers::pi;

Params quickParams() {
  Params params = exactParams("rtxgi");
  params.rays = 32;
  return params;
}

double worstOf(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

Measurement furnaceEnergy(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.5f, 1));
  if (variant.tracer == "reference")
    return near(answersAt(bench, scene, {}, {}, furnacePoints(), variant),
                std::vector<double>(5, kPi / 0.5), 0);
  const auto field = bench.field(scene, furnaceLayout(scene.scene), quickParams(), variant);
  convergeField(*field, {.average = 4});
  return within(worstError(field->query(furnacePoints()), kPi / 0.5), 2e-4, "error");
}

// L = 0.3 / (1 - 0.5) rounded to nearest at every update.
Measurement furnaceFormat(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.5f, 0.3f));
  Params params = formatParams("rtxgi", variant.format);
  params.rays = 32;
  params.encoding_gamma = 1;
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params, variant);
  convergeField(*field, {.average = 4});
  const double level = 0.6;
  // A step of (1 - albedo) x what is missing is lost below half an ulp; half an ulp of the answer.
  const double half = formatUlp(variant.format, 1, level) / 2 / level;
  return within(worstError(field->query(furnacePoints()), kPi * level), half / 0.5 + half + 2e-4,
                "error");
}

Measurement albedoZero(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0)), true);
  builder.pointLight(Vec3f(1, 1.5f, 1), Vec3f(100));
  const BuiltScene scene(builder.finish());
  return within(worstOf(answersAt(bench, scene, furnaceLayout(scene.scene), quickParams(),
                                  furnacePoints(), variant)
                            .e),
                0, "largest E");
}

// After n updates from black the field holds n bounces: Le (1 - rho^n) / (1 - rho).
Measurement albedoNearOne(Workbench& bench, const CaseVariant& variant) {
  const float rho = 0.999f;
  const double r = static_cast<double>(rho);
  const BuiltScene scene(furnace(rho, 1));
  const std::vector<QueryPoint> point{upAt(Vec3f(1))};
  if (variant.tracer == "reference")
    return near(answersAt(bench, scene, {}, {}, point, variant, {.samples = 1024}),
                std::vector<double>(1, kPi / (1 - r)), 0);
  constexpr int kUpdates = 200;
  Params params = quickParams();
  params.encoding_gamma = 1;
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params, variant);
  for (int i = 0; i < kUpdates; ++i) field->update(0, {}, {});
  const double truth = kPi * (1 - std::pow(r, kUpdates)) / (1 - r);
  // A bounce sums 32 rays and 8 probes in fp32, 40 roundings of 2^-24 at most; light in the field
  // has bounced 100 times on average.
  return within(worstError(field->query(point), truth), 40 * 0x1p-24 * 100,
                "error after 200 bounces");
}

Measurement albedoOne(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(1, 1));
  const std::vector<QueryPoint> point{upAt(Vec3f(1))};
  if (variant.tracer == "reference") {
    const double e = answersAt(bench, scene, {}, {}, point, variant, {.samples = 32}).e.front();
    return checked(std::isfinite(e) && e > 0, fmt::format("ends, E {:.3g}", e));
  }
  const auto field = bench.field(scene, furnaceLayout(scene.scene), quickParams(), variant);
  const ConvergeReport report = convergeField(*field, {.average = 1, .max_burn_in = 24});
  const double e = static_cast<double>(field->query(point).front().y);
  return checked(!report.settled && std::isfinite(e),
                 fmt::format("ends after {} updates, {}, E {:.3g}", report.updates(),
                             report.settled ? "settled" : "reported as not settled", e));
}

Measurement albedoRange(Workbench& bench, const CaseVariant&) {
  Measurement result = checked(true, "");
  for (const char* bad : {"[1.5, 0, 0, 1]", "[0, -0.1, 0, 1]", "[0, 0, 1e999, 1]"}) {
    TinyGltf gltf;
    gltf.root["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = "FACTOR";
    const auto load = [&] {
      std::string text = gltf.root.dump();
      text.replace(text.find("\"FACTOR\""), 8, bad);
      text.insert(text.find("\"byteLength\":" + std::to_string(gltf.bin.size())),
                  "\"uri\":\"tiny.bin\",");
      writeBytes(bench.folder() / "tiny.bin", gltf.bin);
      writeBytes(bench.folder() / "tiny.gltf", text);
      loadScene(bench.folder() / "tiny.gltf");
    };
    const Measurement one = refused(load, {"tiny.gltf"});
    if (one.verdict != Verdict::holds) return one;
    result = one;
  }
  return result;
}

// Lamps on a wall, in a corner and at a probe.
Measurement lampInOddPlaces(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0.5f)), true);
  for (const Vec3f& p : {Vec3f(1, 0, 1), Vec3f(0), Vec3f(0.4f)}) builder.pointLight(p, Vec3f(1));
  const BuiltScene scene(builder.finish());
  const ProbeLayout layout = furnaceLayout(scene.scene);
  std::vector<QueryPoint> points = furnacePoints();
  for (const Vec3f& p : layout.positions) points.push_back(upAt(p));
  const Answers answers = answersAt(bench, scene, layout, quickParams(), points, variant);
  const auto [least, most] = std::minmax_element(answers.e.begin(), answers.e.end());
  return checked(*least >= 0 && std::isfinite(*most),
                 fmt::format("finite, E {:.3g} to {:.3g}", *least, *most));
}

Measurement unlit(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.9f, 0));
  return within(worstOf(answersAt(bench, scene, furnaceLayout(scene.scene), quickParams(),
                                  furnacePoints(), variant)
                            .e),
                0, "largest E");
}

// The ratio of successive changes of the field is the albedo.
Measurement feedbackGain(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.7f, 1));
  const auto field = bench.field(scene, furnaceLayout(scene.scene), quickParams(), variant);
  const ConvergeReport report = convergeField(*field, {.tolerance = 1e-3, .average = 1});
  const double e = worstError(field->query(furnacePoints()), kPi / 0.3);
  // Changes of 1e-3 of the field, known to the 1e-6 of sums in fp32, over each other.
  return both(within(std::abs(report.contraction - 0.7), 2e-3, "gain - albedo"),
              checked(e < 0.01, fmt::format("E off by {:.2g}", e)));
}

Measurement wallsOutsideLattice(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.6f, 1));
  const auto field = bench.field(
      scene, fullLattice({Vec3f(0.7f), Vec3f(1.3f)}, Vec3i(2, 2, 2), scene.scene.bounds),
      quickParams(), variant);
  convergeField(*field, {.average = 2});
  return within(worstError(field->query(furnacePoints()), kPi / 0.4), 2e-4, "error");
}

// The field fades over one s_i outside the bounds, and bounces from walls there with it.
Measurement wallsOutsideBounds(Workbench& bench, const CaseVariant& variant) {
  const auto loss = [&](double share) {
    Scene scene = furnace(0.6f, 1);
    const float inset = static_cast<float>(share);  // s_i is 1 m
    scene.bounds = {Vec3f(inset), Vec3f(2 - inset)};
    const BuiltScene built(std::move(scene));
    const auto field = bench.field(
        built, fullLattice({Vec3f(0.5f), Vec3f(1.5f)}, Vec3i(2, 2, 2), built.scene.bounds),
        quickParams(), variant);
    convergeField(*field, {.average = 1});
    const std::vector<QueryPoint> middle{upAt(Vec3f(1))};
    return worstError(field->query(middle), kPi / 0.4);
  };
  const double share = breakingPoint(
      1e-3, 0.45, [&](double s) { return loss(s) <= 0.01; }, 0.1);
  return limitAt(share,
                 fmt::format("E loses 1 % once walls lie {:.2g} s_i outside the bounds", share));
}

}  // namespace

std::vector<StabilityCase> lightingCases() {
  const auto tracers = bothTracers();
  const auto all = bothTracersAndReference();
  return {
      {"lighting.furnace", "closed room, Le 1, albedo 0.5",
       "E = pi Le / (1 - albedo): 2e-4 (1e-4 of the series, texel sums); reference 5 sigma", "P1",
       all, furnaceEnergy},
      {"lighting.furnace_format", "the same, stored in each format, nearest",
       "half an ulp / (1 - albedo) stays missing, half an ulp in the answer, 2e-4", "P1",
       irradianceFormats(), furnaceFormat},
      {"lighting.albedo_0", "black walls and a lamp", "no bounce: E = 0 exactly", "G17", all,
       albedoZero},
      {"lighting.albedo_999", "albedo 0.999",
       "Le (1 - rho^n) / (1 - rho) after n = 200 bounces, 40 roundings each; reference L = 1000, 5 "
       "sigma",
       "G18", all, albedoNearOne},
      {"lighting.albedo_1", "albedo 1, the series has no end",
       "bounded: ends, finite, reported as not settled", "G19", all, albedoOne},
      {"lighting.albedo_range",
       "albedo above 1, below 0, infinite",
       "error naming the file",
       "G20",
       {},
       albedoRange},
      {"lighting.lamp_places", "lamps on a wall, in a corner, at a probe", "finite", "G21", all,
       lampInOddPlaces},
      {"lighting.none", "no light", "E = 0 exactly", "G22", all, unlit},
      {"lighting.gain", "gain of the feedback", "the series contracts by the albedo within 2e-3",
       "P2", tracers, feedbackGain},
      {"lighting.outside_lattice", "walls outside the lattice, inside the bounds",
       "their bounces count: E = pi Le / (1 - albedo) within 2e-4", "P3", tracers,
       wallsOutsideLattice},
      {"lighting.outside_bounds",
       "walls outside the bounds",
       "the field fades over one s_i, bounces with it: never more than 1 % lost",
       "P3",
       {{"embree", ""}},
       wallsOutsideBounds},
  };
}

}  // namespace probelab
