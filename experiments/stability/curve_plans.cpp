// SPDX-License-Identifier: GPL-3.0-or-later
// The curves, a function a panel. Bounds: what a default truth of evaluate (0.02) would not notice
// in geometry, 1e-3; 1 % where light itself is lost or leaks.
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "measures.h"
#include "stability/curves.h"

namespace probelab {
namespace {

constexpr double kSameBound = 1e-3, kLightBound = 0.01;

// 10^(k / per_decade) from one end to the other.
std::vector<double> decades(int first, int last, int per_decade) {
  std::vector<double> xs;
  for (int k = first * per_decade; k <= last * per_decade; ++k)
    xs.push_back(std::pow(10.0, static_cast<double>(k) / per_decade));
  return xs;
}

Params halfParams(const std::string& preset) {
  Params params = formatParams(preset, "rgba16f");
  params.moment_format = PL_FORMAT_RG16F;
  return params;
}

struct Traced {
  const char *id, *tracer, *what;
  Params params;
};

std::vector<Traced> tracersAndFormats() {
  return {{"embree", "embree", "Embree, fp32", exactParams("rtxgi")},
          {"rayquery", "rayquery", "ray query, fp32", exactParams("rtxgi")},
          {"fp16", "embree", "Embree, fp16", halfParams("rtxgi")},
          {"reference", "reference", "path tracer", exactParams("rtxgi")}};
}

// Both panels of places hold a room against itself where it is easiest. The path tracer's answers
// are noisy once its paths part, so their mean counts: 100 points of 4,096 samples, 4e-4.
auto pillarError(const Traced& of, PillarPlace (*place)(double x), double easy) {
  const auto base = std::make_shared<Answers>();
  return [of, place, easy, base](Workbench& bench, double x) {
    const auto answers = [&](double at) {
      return pillarAnswers(bench, {of.tracer, ""}, of.params, place(at));
    };
    if (base->e.empty()) *base = answers(easy);
    const Answers there = answers(x);
    return of.tracer == std::string("reference") ? meanDifference(there, *base)
                                                 : rmsDifference(there, *base);
  };
}

PillarPlace farAway(double x) { return {.metres = x, .samples = 4096}; }
PillarPlace inFile(double x) { return {.metres = x, .rebased = true}; }
PillarPlace scaledBy(double x) { return {.scale = x}; }

std::vector<CurvePlan> distanceCurves() {
  const CurvePlan base{"distance.", "", "", "distance from the origin, m",
                       "E against the same room at the origin, rms (path tracer: mean); wall: share that leaks",
                       kSameBound, 1, decades(0, 6, 2), {}};
  std::vector<CurvePlan> curves;
  for (const Traced& of : tracersAndFormats()) {
    CurvePlan& curve = curves.emplace_back(base);
    curve.id += of.id, curve.tracer = of.tracer, curve.what = of.what;
    curve.error = pillarError(of, farAway, 0);
  }
  CurvePlan& rebased = curves.emplace_back(base);
  rebased.id += "file", rebased.tracer = "embree", rebased.what = "Embree, from a file";
  rebased.error = pillarError(tracersAndFormats().front(), inFile, 0);
  CurvePlan& furnace = curves.emplace_back(base);
  furnace.id += "furnace", furnace.tracer = "embree", furnace.what = "Embree, a furnace's energy";
  furnace.error = [](Workbench& bench, double x) {
    return shiftedError(bench, {"embree", ""}, x);
  };
  CurvePlan& wall = curves.emplace_back(base);
  wall.id += "wall", wall.tracer = "reference", wall.what = "path tracer, a wall of 1 cm";
  wall.error = [](Workbench& bench, double x) {
    return wallLeak(bench, {"reference", ""}, {}, 0.01, 0.5, x);
  };
  return curves;
}

std::vector<CurvePlan> scaleCurves() {
  std::vector<CurvePlan> curves;
  for (const Traced& of : tracersAndFormats())
    curves.push_back({std::string("scale.") + of.id, of.tracer, of.what, "scale of the room",
                      "E against scale 1, rms (path tracer: mean)", kSameBound, 1, decades(-4, 4, 2),
                      pillarError(of, scaledBy, 1)});
  return curves;
}

std::vector<CurvePlan> contrastCurves() {
  std::vector<CurvePlan> curves;
  for (const double gamma : {1.0, 5.0})
    for (const char* format : {"rgba32f", "rgba16f", "r11g11b10f", "rgb10a2"}) {
      Params params = formatParams("classic", format);
      params.rays = 32;
      params.encoding_gamma = gamma;
      const std::string encoding = gamma == 1 ? "" : ", gamma 5";
      curves.push_back({std::string("contrast.") + format + (gamma == 1 ? "" : "_gamma5"), "embree",
                        format + encoding, "radiance, nit, beside 1",
                        "E at the probe, relative", kLightBound, 1, decades(-6, 6, 2),
                        [params](Workbench& bench, double x) {
                          return storedError(bench, params, x);
                        }});
    }
  return curves;
}

std::vector<CurvePlan> darkRoomCurves() {
  std::vector<CurvePlan> curves;
  for (const char* preset : {"classic", "gdc2019", "majercik2021", "rtxgi", "probelab"})
    curves.push_back({std::string("dark_room.") + preset, "embree", preset,
                      "radiance of the darker room, nit",
                      "E half-way between probes, relative", kLightBound, 1, decades(-6, 0, 2),
                      [params = exactParams(preset)](Workbench& bench, double x) {
                        // Two rooms of one radiance have no contrast.
                        return x == 1 ? 0 : std::abs(leakedShare(bench, params, x)) * (1 - x) / x;
                      }});
  return curves;
}

std::vector<CurvePlan> wallCurves() {
  const auto embree = [](const char* preset) {
    return Traced{preset, "embree", preset, exactParams(preset)};
  };
  const Traced all[] = {
      embree("classic"),
      embree("gdc2019"),
      embree("majercik2021"),
      embree("rtxgi"),
      embree("probelab"),
      {"rtxgi_rayquery", "rayquery", "rtxgi, ray query", exactParams("rtxgi")},
      {"rtxgi_fp16", "embree", "rtxgi, fp16", halfParams("rtxgi")},
      {"probelab_fp16", "embree", "probelab, fp16", halfParams("probelab")},
      {"reference", "reference", "path tracer", {}}};
  std::vector<CurvePlan> curves;
  for (const Traced& of : all)
    curves.push_back({std::string("wall.") + of.id, of.tracer, of.what,
                      "thickness of the wall, m",
                      "share of the bright room that leaks", kLightBound, 0.5,
                      {0.001, 0.002, 0.003, 0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.3, 0.5},
                      [of](Workbench& bench, double x) {
                        return wallLeak(bench, {of.tracer, ""}, of.params, x, 1);
                      }});
  return curves;
}

std::vector<CurvePlan> albedoCurves() {
  const auto params = [](const char* format, double gamma, int rounding) {
    Params p = formatParams("rtxgi", format);
    p.rays = 32, p.encoding_gamma = gamma, p.rounding = rounding;
    return p;
  };
  const Traced all[] = {
      {"rgba32f", "embree", "rgba32f", params("rgba32f", 1, 0)},
      {"rayquery", "rayquery", "rgba32f, ray query", params("rgba32f", 1, 0)},
      {"rgba32f_gamma5", "embree", "rgba32f, gamma 5", params("rgba32f", 5, 0)},
      {"rgba16f", "embree", "rgba16f", params("rgba16f", 1, 0)},
      {"rgba16f_gamma5", "embree", "rgba16f, gamma 5", params("rgba16f", 5, 0)},
      {"rgba16f_dithered", "embree", "rgba16f, dithered", params("rgba16f", 1, 1)},
      {"r11g11b10f", "embree", "r11g11b10f", params("r11g11b10f", 1, 0)},
      {"r11g11b10f_dithered", "embree", "r11g11b10f, dithered", params("r11g11b10f", 1, 1)},
      {"rgb10a2", "embree", "rgb10a2", params("rgb10a2", 1, 0)}};
  std::vector<CurvePlan> curves;
  for (const Traced& of : all)
    curves.push_back({std::string("albedo.") + of.id, of.tracer, of.what,
                      "1 - albedo", "mean E of its bounces, relative", kLightBound,
                      1, {0.001, 0.002, 0.003, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1},
                      [of](Workbench& bench, double x) {
                        return albedoError(bench, {of.tracer, ""}, of.params, 1 - x);
                      }});
  return curves;
}

}  // namespace

std::vector<CurvePlan> precisionCurves() {
  std::vector<CurvePlan> all;
  for (const auto& panel : {distanceCurves, scaleCurves, contrastCurves, darkRoomCurves, wallCurves,
                            albedoCurves})
    for (CurvePlan& curve : panel()) all.push_back(std::move(curve));
  return all;
}

}  // namespace probelab
