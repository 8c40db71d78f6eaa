// SPDX-License-Identifier: GPL-3.0-or-later
// Furnaces, albedos from 0 to 1, lamps in odd places, no light at all, walls outside the lattice.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/rng.h"
#include "cases.h"
#include "closed_forms.h"
#include "hostile_files.h"
#include "scene/load.h"

namespace probelab {
namespace {

using std::numbers::pi;

Params fewRays() {
  Params params = exactParams("rtxgi");
  params.rays = 32;
  return params;
}

// Relative rounding of an answer of a field that reflects `albedo`, bounce by bounce: 32 rays and 8
// probes, 40 roundings of 2^-24; log2, exp2 and their sum, 7 units of 2^-23 (Vulkan's precision of
// pow), of the fifth root and of its fifth power, the former five times.
double roundingOf(double albedo) { return (40 * 0x1p-24 + 42 * 0x1p-23) / (1 - albedo); }

// 60 updates leave 0.6^60 = 5e-14 of the series, or less.
std::vector<Vec4f> afterAllBounces(ProbeField& field) {
  for (uint64_t u = 0; u < 60; ++u) field.update(u, {}, {});
  return field.query(furnacePoints());
}

Measurement furnaceEnergy(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.5f, 1));
  if (variant.tracer == "reference")
    return near(answersAt(bench, scene, {}, {}, furnacePoints(), variant, {.samples = 16384}),
                std::vector<double>(5, pi / 0.5), 0);
  const auto field = bench.field(scene, furnaceLayout(scene.scene), fewRays(), variant);
  return within(worstError(afterAllBounces(*field), pi / 0.5), roundingOf(0.5), "error");
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
  return within(worstError(field->query(furnacePoints()), pi * level), half / 0.5 + half + 2e-4,
                "error");
}

Measurement albedoZero(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0)), true);
  builder.pointLight(Vec3f(1, 1.5f, 1), Vec3f(100));
  const BuiltScene scene(builder.finish());
  return within(largestOf(answersAt(bench, scene, furnaceLayout(scene.scene), fewRays(),
                                    furnacePoints(), variant)
                              .e),
                0, "largest E");
}

// A bounce sums 32 rays and 8 probes in fp32: 40 roundings of at most 2^-24, uniform and of either
// sign, so three deviations; every bounce repeats them, and light has bounced n / 2 times on
// average.
double bouncesError(int n) { return 3 * std::sqrt(40.0 / 3) * 0x1p-24 * n / 2; }

// After n updates from black the field holds n bounces: Le (1 - rho^n) / (1 - rho).
Measurement albedoNearOne(Workbench& bench, const CaseVariant& variant) {
  const float rho = 0.999f;
  const double r = static_cast<double>(rho);
  const BuiltScene scene(furnace(rho, 1));
  const std::vector<QueryPoint> point{upAt(Vec3f(1))};
  if (variant.tracer == "reference")
    return near(answersAt(bench, scene, {}, {}, point, variant, {.samples = 1024}),
                std::vector<double>(1, pi / (1 - r)), 0);
  constexpr int kUpdates = 200;
  Params params = fewRays();
  params.encoding_gamma = 1;
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params, variant);
  for (int i = 0; i < kUpdates; ++i) field->update(0, {}, {});
  const double truth = pi * (1 - std::pow(r, kUpdates)) / (1 - r);
  return within(worstError(field->query(point), truth), bouncesError(kUpdates),
                "error after 200 bounces");
}

// A path of n vertices brings pi (s^-n - 1) / (1 / s - 1), survival s = 0.9995: more than 2000 pi x
// with probability 1 / (1 + x). That has no mean; what the mean of a few paths is like is known.
constexpr double kLastingRadiance = 2000, kTypicalMean = 5;
double shareOfLastingPaths(int paths) {
  constexpr int kTries = 100000;
  Rng rng(1, RngStream::stability, 1);
  int above = 0;
  for (int i = 0; i < kTries; ++i) {
    double sum = 0;
    for (int p = 0; p < paths; ++p) sum += 1 / (1 - rng.nextDouble()) - 1;
    above += sum > kTypicalMean * paths ? 1 : 0;
  }
  return static_cast<double>(above) / kTries;
}

Measurement albedoOne(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(1, 1));
  const std::vector<QueryPoint> point{upAt(Vec3f(1))};
  if (variant.tracer == "reference") {
    constexpr int kPaths = 32, kPoints = 64;  // the fewest that a reference has
    const std::vector<QueryPoint> points(kPoints, point.front());
    const std::vector<double> e =
        answersAt(bench, scene, {}, {}, points, variant, {.samples = kPaths}).e;
    const auto above = std::ranges::count_if(
        e, [](double one) { return one > kTypicalMean * kLastingRadiance * pi; });
    const double share = shareOfLastingPaths(kPaths);
    return within(std::abs(static_cast<double>(above) / kPoints - share),
                  4 * std::sqrt(share * (1 - share) / kPoints),
                  fmt::format("ends; of {} means of {} paths {} are above {:g} pi, law {:.3g}: off by",
                              kPoints, kPaths, above, kTypicalMean * kLastingRadiance, share));
  }
  Params params = fewRays();
  params.encoding_gamma = 1;
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params, variant);
  const ConvergeReport report = convergeField(*field, {.average = 1, .max_burn_in = 24});
  const int n = report.updates();
  return both(
      checked(!report.settled, fmt::format("ends after {} updates, {}", n,
                                           report.settled ? "settled" : "reported as not settled")),
      within(worstError(field->query(point), pi * n), bouncesError(n), "E / pi n - 1:"));
}

Measurement albedoRange(Workbench& bench, const CaseVariant&) {
  const auto load = [&](const std::string& factor) {
    TinyGltf gltf;
    gltf.root["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = "FACTOR";
    std::string text = gltf.root.dump();
    text.replace(text.find("\"FACTOR\""), 8, factor);
    text.insert(text.find("\"byteLength\":" + std::to_string(gltf.bin.size())),
                "\"uri\":\"tiny.bin\",");
    writeBytes(bench.folder() / "tiny.bin", gltf.bin);
    writeBytes(bench.folder() / "tiny.gltf", text);
    loadScene(bench.folder() / "tiny.gltf");
  };
  load("[1, 0, 0.5, 1]");  // the value alone makes the others wrong
  const std::vector<std::string> named = {"tiny.gltf", "material 'paint'", "baseColorFactor"};
  for (const char* value : {"1.5", "-0.1"}) {
    const Measurement one = refused([&] { load(fmt::format("[0, {}, 0, 1]", value)); }, named);
    if (one.verdict != Verdict::holds) return one;
  }
  // JSON has neither of them.
  for (const char* value : {"1e999", "NaN"}) {
    const Measurement one =
        refused([&] { load(fmt::format("[0, {}, 0, 1]", value)); }, {"tiny.gltf", "JSON"});
    if (one.verdict != Verdict::holds) return one;
  }
  return checked(true, "4 of 4 refused: 1.5 and -0.1 as baseColorFactor, 1e999 and NaN as no JSON");
}

// Lamps on a wall, in a corner and at a probe, in the middle.
const Vec3d kOddPlaces[] = {{1, 0, 1}, {0, 0, 0}, {1, 1, 1}};

// What the walls send to the middle after one bounce: albedo / pi x sum of cos / d^2.
double firstBounce(const Vec3d& w) {
  const Vec3d a(std::abs(w.x), std::abs(w.y), std::abs(w.z));
  const std::size_t axis = a.x >= a.y && a.x >= a.z ? 0 : (a.y >= a.z ? 1 : 2);
  const Vec3d hit = Vec3d(1) + w / a[axis];
  double sum = 0;
  for (const Vec3d& lamp : kOddPlaces) {
    const double d = length(lamp - hit), height = std::abs(lamp[axis] - hit[axis]);
    if (height > 0) sum += height / (d * d * d);
  }
  return 0.5 / pi * sum;
}

// The walls' mean of E in a room of area A: albedo / (1 - albedo) x flux / A, flux of 4 pi, 2 pi
// and pi / 2. At one random place in each of the walls' cells, from what they scatter.
Measurement wallsMean(Workbench& bench, const BuiltScene& scene) {
  constexpr int kCells = 12;
  Rng rng(17, RngStream::stability);
  std::vector<QueryPoint> points;
  for (std::size_t wall = 0; wall < 6; ++wall)
    for (int i = 0; i < kCells * kCells; ++i) {
      const std::size_t axis = wall / 2;
      Vec3f p, normal;
      normal[axis] = wall % 2 == 0 ? 1.0f : -1.0f;
      p[axis] = wall % 2 == 0 ? 0.0f : 2.0f;
      p[(axis + 1) % 3] = 2 * (static_cast<float>(i % kCells) + rng.nextFloat()) / kCells;
      p[(axis + 2) % 3] = 2 * (static_cast<float>(i / kCells) + rng.nextFloat()) / kCells;
      points.push_back({p, normal, normal});
    }
  const Answers answers =
      answersAt(bench, scene, {}, {}, points, {"reference", ""}, {.samples = 64});
  const double n = static_cast<double>(points.size());
  double mean = 0, squares = 0;
  for (const double e : answers.e) mean += e / n, squares += e * e / n;
  const double truth = 6.5 * pi / 24;
  const double error = std::sqrt((squares - mean * mean) / (n - 1));
  return within(std::abs(mean - truth) / error, 5,
                fmt::format("E {:.4g}, flux / area {:.4g}, standard errors:", mean, truth));
}

Measurement lampInOddPlaces(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0.5f)), true);
  for (const Vec3d& p : kOddPlaces) builder.pointLight(Vec3f(p), Vec3f(1));
  const BuiltScene scene(builder.finish());
  if (variant.tracer == "reference") return wallsMean(bench, scene);
  // Radiance of at most 2.25 x 0.5 / pi jumps at the room's 12 edges, arcs of acos(1/3), where rays
  // stand for strata that are cut: four deviations of as many uniform shares.
  const double cut = 12 * std::acos(1.0 / 3) / std::sqrt(kProbeStratum);
  return within(probeError(bench, scene, variant, firstBounce),
                4 * std::sqrt(cut / 12) * kProbeStratum * 2.25 * 0.5 / pi, "first bounce off by");
}

Measurement unlit(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.9f, 0));
  return within(largestOf(answersAt(bench, scene, furnaceLayout(scene.scene), fewRays(),
                                    furnacePoints(), variant)
                              .e),
                0, "largest E");
}

// The ratio of successive changes of the field is the albedo.
Measurement feedbackGain(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.7f, 1));
  const auto field = bench.field(scene, furnaceLayout(scene.scene), fewRays(), variant);
  const ConvergeReport report = convergeField(*field, {.tolerance = 1e-3, .average = 1});
  const double e = worstError(field->query(furnacePoints()), pi / 0.3);
  // Changes of 1e-3 of the field, known to the 1e-6 of sums in fp32, over each other.
  return both(within(std::abs(report.contraction - 0.7), 2e-3, "gain - albedo"),
              checked(e < 0.01, fmt::format("E off by {:.2g}", e)));
}

Measurement wallsOutsideLattice(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.6f, 1));
  const auto field = bench.field(
      scene, fullLattice({Vec3f(0.7f), Vec3f(1.3f)}, Vec3i(2, 2, 2), scene.scene.bounds),
      fewRays(), variant);
  return within(worstError(afterAllBounces(*field), pi / 0.4), roundingOf(0.6), "error");
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
        fewRays(), variant);
    convergeField(*field, {.average = 1});
    const std::vector<QueryPoint> middle{upAt(Vec3f(1))};
    return worstError(field->query(middle), pi / 0.4);
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
       "E = pi Le / (1 - albedo) within the roundings of sums and pow in fp32; reference 5 sigma",
       "P1", all, furnaceEnergy},
      {"lighting.furnace_format", "the same, stored in each format, nearest",
       "half an ulp / (1 - albedo) stays missing, half an ulp in the answer, 2e-4", "P1",
       irradianceFormats(), furnaceFormat},
      {"lighting.albedo_0", "black walls and a lamp", "no bounce: E = 0 exactly", "G17", all,
       albedoZero},
      {"lighting.albedo_999", "albedo 0.999",
       "Le (1 - rho^n) / (1 - rho) after n = 200 bounces, 3 deviations of 40 roundings each; "
       "reference L = 1000, 5 sigma of some 2.6 %",
       "G18", all, albedoNearOne},
      {"lighting.albedo_1", "albedo 1, the series has no end",
       "ends, not settled: E = pi n after n bounces, roundings as above; reference: its paths' "
       "distribution, 4 deviations",
       "G19", all, albedoOne},
      {"lighting.albedo_range",
       "albedo above 1, below 0, infinite, NaN",
       "error naming file, material and member; a file with 0, 0.5 and 1 loads",
       "G20",
       {},
       albedoRange},
      {"lighting.lamp_places", "lamps on a wall, in a corner, at a probe",
       "reference: flux / area, 5 sigma; probe: sum of cos / d^2 within 4 errors of cut strata",
       "G21", all, lampInOddPlaces},
      {"lighting.none", "no light", "E = 0 exactly", "G22", all, unlit},
      {"lighting.gain", "gain of the feedback", "the series contracts by the albedo within 2e-3",
       "P2", tracers, feedbackGain},
      {"lighting.outside_lattice", "walls outside the lattice, inside the bounds",
       "their bounces count: E = pi Le / (1 - albedo) within the roundings of fp32", "P3", tracers,
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
