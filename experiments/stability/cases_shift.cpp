// SPDX-License-Identifier: GPL-3.0-or-later
// Where a scene lies, how large it is, how thin its walls are.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "cases.h"
#include "hostile_files.h"
#include "measures.h"

namespace probelab {
namespace {

Measurement scaled(Workbench& bench, const CaseVariant& variant) {
  const auto answers = [&](double scale) {
    return pillarAnswers(bench, variant, exactParams("rtxgi"), {.scale = scale});
  };
  const Answers one = answers(1);
  return both(near(answers(1e-3), one, 1e-3), near(answers(1e3), one, 1e-3));
}

// The file's node far away, its vertices near the node.
Measurement shiftedNode(Workbench& bench, const CaseVariant&) {
  const Scene here = loadTiny(bench, TinyGltf());
  double worst = 0;
  for (const double metres : {1e3, 1e5, 9e6}) {
    TinyGltf moved;
    moved.root["nodes"][0]["translation"] = {metres, -metres, metres};
    const Scene there = loadTiny(bench, moved);
    worst =
        larger(worst, std::abs(length(there.origin - here.origin) / (metres * std::sqrt(3)) - 1));
    for (std::size_t i = 0; i < here.geometry->positions.size(); ++i)
      worst = larger(worst, static_cast<double>(length(there.geometry->positions[i] -
                                                       here.geometry->positions[i])));
  }
  // Half an ulp of fp64 at 9e6 m, through the transform and the origin: 4 x 2^-53 x 9e6 m; the
  // local positions, below 1 m, round to 2^-24.
  return within(worst, 4 * 0x1p-53 * 9e6 + 0x1p-24, "local positions move by, m:");
}

Measurement shifted(Workbench& bench, const CaseVariant& variant) {
  return within(shiftedError(bench, variant, 1e3), 1e-4, "error");
}

Measurement shiftLimit(Workbench& bench, const CaseVariant& variant) {
  const double metres = breakingPoint(
      1e3, 1e7, [&](double d) { return shiftedError(bench, variant, d) <= 1e-4; }, 0.1);
  return limitAt(metres, fmt::format("error above 1e-4 from {:.3g} m on", metres));
}

Measurement sealedRoom(Workbench& bench, const CaseVariant& variant) {
  const float thickness = variant.format == "1cm" ? 0.01f : variant.format == "0.1mm" ? 1e-4f : 0;
  const BuiltScene scene(twoRooms(thickness, 0.5f));
  std::vector<QueryPoint> points = randomPoints({Vec3f(0.01f, 0, 0), Vec3f(2)}, 64, 6);
  points.push_back({Vec3f(thickness / 2, 1, 1), Vec3f(1, 0, 0), Vec3f(-1, 0, 0)});
  points.push_back({Vec3f(thickness / 2, 0, 0), Vec3f(1, 0, 0), Vec3f(-1, 0, 0)});
  points.push_back(upAt(Vec3f(0.05f, 0, 1)));
  double most = 0;
  for (const double e :
       answersAt(bench, scene, {}, {}, points, {"reference", ""}, {.samples = 512}).e)
    most = larger(most, e);
  return within(most, 0, "largest E in the dark room");
}

// Probes 0.25 m from the wall's middle.
double leak(Workbench& bench, const std::string& preset, double thickness) {
  return wallLeak(bench, {}, exactParams(preset), thickness, 0.5);
}

// Leaks shrink with the wall; looked for from thick (holds) to thin, so in its inverse.
Measurement thinWall(Workbench& bench, const CaseVariant& variant) {
  const double thinnest =
      1 / breakingPoint(
              1 / 0.45, 1e3,
              [&](double inverse) { return leak(bench, variant.format, 1 / inverse) <= 0.01; },
              0.1);
  if (thinnest <= 0.0011)
    return checked(true, fmt::format("leak {:.2g} at 1 mm", leak(bench, variant.format, 0.001)));
  return limitAt(
      thinnest, fmt::format("leak above 1 % below {:.3g} m of wall at 0.5 m of spacing", thinnest));
}

}  // namespace

std::vector<StabilityCase> shiftCases() {
  std::vector<CaseVariant> presets;
  for (const char* preset : {"rtxgi", "probelab"}) presets.push_back({"", preset});
  return {
      {"geometry.scale", "the scene a thousandth and a thousand times as large",
       "candela times scale^2: E as at scale 1 within 1e-3; reference 5 standard errors", "G8 P19",
       bothTracersAndReference(), scaled},
      {"geometry.shift_node",
       "a node 1 to 9,000 km from the origin",
       "positions relative to the box's centre, in double: unchanged but for rounding",
       "G9 P18",
       {},
       shiftedNode},
      {"geometry.shift_1km", "a furnace 1 km from the local origin",
       "E = pi Le / (1 - albedo) within 1e-4", "G9 P18", bothTracers(), shifted},
      {"geometry.shift_limit", "a furnace farther from the local origin",
       "1e-4 of E up to 1e7 m; fp32 positions end it earlier", "G9 P18", bothTracers(), shiftLimit},
      {"geometry.sealed_room",
       "dark room behind a wall of 1 cm, 0.1 mm, a sheet",
       "error-bounded ray origins: E = 0 exactly",
       "G11",
       {{"reference", "1cm"}, {"reference", "0.1mm"}, {"reference", "sheet"}},
       sealedRoom},
      {"geometry.thin_wall", "probes on both sides of a wall that gets thinner",
       "leak at most 1 % of the bright room down to 1 mm; moments need about 0.18 d sin(angle)",
       "G11 P11", presets, thinWall},
  };
}

}  // namespace probelab
