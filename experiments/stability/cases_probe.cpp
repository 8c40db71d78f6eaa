// SPDX-License-Identifier: GPL-3.0-or-later
// Probes in walls, on walls, alone, on each other, too many, and what their states do.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "cases.h"
#include "ddgi/directions.h"
#include "measures.h"
#include "shared/octahedral.h"

namespace probelab {
namespace {

using std::numbers::pi;

// Rooms of radiance 1 and 2 with 1 m of solid between x = 2 and 3.
Scene solidBetween() {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0), Vec3f(1)), true);
  builder.box(Vec3f(3, 0, 0), Vec3f(5, 2, 2), builder.material(Vec3f(0), Vec3f(2)), true);
  return builder.finish();
}

Params classified() {
  Params params = exactParams("classic");
  params.rays = 64;
  params.classification = PL_CLASSIFY_INSIDE;
  params.fallback = PL_FALLBACK_NEAREST;
  return params;
}

// Columns at 0.25 + 0.75 k: one of seven lies in the solid.
Measurement insideSolid(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(solidBetween());
  const auto field = bench.field(scene,
                                 fullLattice({Vec3f(0.25f, 0.5f, 0.5f), Vec3f(4.75f, 1.5f, 1.5f)},
                                             Vec3i(7, 2, 2), scene.scene.bounds),
                                 classified(), variant);
  field->update(0, {}, {});
  std::vector<QueryPoint> left, right;
  for (const float x : {0.5f, 1.5f, 2.0f, 2.4f}) left.push_back(upAt(Vec3f(x, 1, 1)));
  for (const float x : {2.6f, 3.0f, 4.5f}) right.push_back(upAt(Vec3f(x, 1, 1)));
  const double worst =
      larger(worstError(field->query(left), pi), worstError(field->query(right), 2 * pi));
  const uint32_t active = field->states().activeCount();
  return both(checked(active == 24, fmt::format("{} of 28 active", active)),
              within(worst, 1e-5, "error"));
}

// The whole lattice in the solid.
Measurement allInside(Workbench& bench, const CaseVariant&) {
  const BuiltScene scene(solidBetween());
  return refused(
      [&] {
        bench.field(scene,
                    fullLattice({Vec3f(2.3f, 0.5f, 0.5f), Vec3f(2.7f, 1.5f, 1.5f)}, Vec3i(2, 2, 2),
                                scene.scene.bounds),
                    classified());
      },
      {"none of 8 probes"});
}

// Answers of a furnace whose outermost probes lie `distance` from its walls.
std::vector<Vec4f> besideWalls(Workbench& bench, const CaseVariant& variant, double distance) {
  const BuiltScene scene(furnace(0.5f, 1));
  const Vec3f inset(static_cast<float>(distance));
  Params params = exactParams("rtxgi");
  params.rays = 32;
  const auto field =
      bench.field(scene, fullLattice({inset, Vec3f(2) - inset}, Vec3i(3, 3, 3), scene.scene.bounds),
                  params, variant);
  convergeField(*field, {.average = 2});
  return field->query(furnacePoints());
}

Measurement onSurface(Workbench& bench, const CaseVariant& variant) {
  double least = 1e9, most = 0;
  for (const Vec4f& e : besideWalls(bench, variant, 0)) {
    least = smaller(least, static_cast<double>(e.y));
    most = larger(most, static_cast<double>(e.y));
  }
  // A probe in a corner sees an octant, a quarter of the cosine around an axis; at least half of
  // the weight is on probes that face the normal: an eighth of pi Le, a sixteenth of pi Le / (1 -
  // 0.5).
  return checked(least >= 2 * pi / 16 && most <= 2 * pi * (1 + 2e-4),
                 fmt::format("{:.2g} to {:.4g} of the closed form, bounds 0.0625 and 1.0002",
                             least / (2 * pi), most / (2 * pi)));
}

Measurement besideSurface(Workbench& bench, const CaseVariant& variant) {
  const double nearest =
      1 / breakingPoint(
              10, 1e12,
              [&](double inverse) {
                return worstError(besideWalls(bench, variant, 1 / inverse), 2 * pi) <= 2e-4;
              },
              0.15);
  return limitAt(nearest,
                 fmt::format("right down to {:.2g} m from the walls of a 2 m room", nearest));
}

// A box around every probe: outside of them all eight are occluded. One ray makes moments without a
// variance, so all weights are 0.
Measurement allOccluded(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0), Vec3f(1));
  for (int i = 0; i < 8; ++i) {
    const Vec3f center(static_cast<float>(i & 1), static_cast<float>(i >> 1 & 1),
                       static_cast<float>(i >> 2));
    builder.box(center - Vec3f(0.1f), center + Vec3f(0.1f), m, true);
  }
  builder.scene().bounds = {Vec3f(0), Vec3f(1)};
  const BuiltScene scene(builder.finish());
  Params params = exactParams("rtxgi");
  params.moment_encoding = PL_MOMENTS_CENTRAL;
  params.rays = 1;
  params.normal_bias = params.view_bias = params.visibility_floor = 0;
  params.crush = PL_CRUSH_NONE;
  params.chebyshev_power = 32;
  setParam(params, "fallback=" + variant.format);
  const auto field = bench.field(
      scene, fullLattice({Vec3f(0), Vec3f(1)}, Vec3i(2, 2, 2), scene.scene.bounds), params);
  field->update(0, {}, {});
  const std::vector<QueryPoint> middle{upAt(Vec3f(0.5f))};
  const double e = static_cast<double>(field->query(middle).front().y);
  const Counters counters = field->counters();
  const double expected = variant.format == "nearest" ? pi : 0;
  return checked(std::abs(e - expected) < 1e-4 && counters.fallback_queries == 1,
                 fmt::format("E {:.4g}, {} counted", e, counters.fallback_queries));
}

Measurement coincident(Workbench& bench, const CaseVariant&) {
  const BuiltScene scene(furnace(0.5f, 1));
  ProbeLayout layout = furnaceLayout(scene.scene);
  layout.lattice.spacing = Vec3f(0);
  layout.bias_length_m = layout.support_radius_m = 0;
  return refused([&] { bench.field(scene, layout, exactParams("rtxgi")); }, {"coincide"});
}

Measurement noProbe(Workbench& bench, const CaseVariant&) {
  const BuiltScene scene(furnace(0.5f, 1));
  ProbeLayout layout = latticeLayout(makeLattice({Vec3f(0.5f), Vec3f(1.5f)}, Vec3i(2, 2, 2)),
                                     scene.scene.bounds, std::vector<uint8_t>(8, 0));
  layout.strategy = "lattice";
  return refused([&] { bench.field(scene, layout, exactParams("rtxgi")); }, {"no probe"});
}

// Under a sky with a direction: the answer is the probe's, wherever the question.
Measurement singleProbe(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.scene().sky.radiance = Vec3f(1);
  builder.scene().sky.linear = Vec3f(0.2f, 0.5f, -0.3f);
  builder.scene().bounds = {Vec3f(-1), Vec3f(1)};
  const BuiltScene scene(builder.finish());
  const Box3f& b = scene.scene.bounds;
  const auto field =
      bench.field(scene, fullLattice(b, Vec3i(1, 1, 1), b), exactParams("rtxgi"), variant);
  field->update(0, {}, {});
  std::vector<QueryPoint> points = randomPoints(b, 200, 8), middle = points;
  for (QueryPoint& p : middle) p.position = Vec3f(0);
  return within(worstDifference(field->query(points), field->query(middle)), 1e-6, "difference");
}

Measurement seesNothing(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.scene().sky.radiance = Vec3f(0.3f);
  builder.scene().bounds = {Vec3f(-1), Vec3f(1)};
  const BuiltScene scene(builder.finish());
  const Box3f& b = scene.scene.bounds;
  const Params params = exactParams("rtxgi");
  const auto field = bench.field(scene, fullLattice(b, Vec3i(2, 2, 2), b), params, variant);
  field->update(0, {}, {});
  double depth = 0;
  for (const Vec2f& m : field->momentTexels())
    depth = larger(depth, std::abs(static_cast<double>(m.x) / params.distance_clamp - 1));
  return both(within(worstError(field->query(furnacePoints(1)), pi * static_cast<double>(0.3f)),
                     1e-5, "E off by"),
              within(depth, 1e-5, "depth off the clamp by"));
}

Measurement tooMany(Workbench&, const CaseVariant&) {
  ProbeLayout layout;
  layout.strategy = "lattice";
  layout.lattice = {Vec3f(0), Vec3f(1), Vec3i(128, 128, 128)};
  layout.positions.resize(1u << 21);
  layout.probe_of_point.resize(1u << 21);
  std::iota(layout.probe_of_point.begin(), layout.probe_of_point.end(), 0);
  layout.bounds = {Vec3f(0), Vec3f(127)};
  layout.bias_length_m = layout.support_radius_m = 1;
  Params params = exactParams("rtxgi");
  params.moment_texels = 16;
  return refused([&] { validateLayout(layout, params); }, {"more than an atlas can index"});
}

Measurement floorLeak(Workbench& bench, const CaseVariant& variant) {
  const double share = leakedShare(bench, exactParams(variant.format), 0.001);
  if (variant.format == "probelab") return within(std::abs(share), 1e-6, "share, either sign:");
  // Floor 0.05, facing 1.2, crush / threshold^2: 0.0054 against 1.2, 0.45 % at equal trilinear
  // weights; the point lies nearer to the dark column.
  if (!(share > 0 && share <= 0.0045)) return within(std::abs(share - 0.00225), 0.00225, "share");
  return limitAt(1 / share, fmt::format("share {:.2g}: a room {:.3g} times as bright doubles it",
                                        share, 1 / share));
}

Measurement relocation(Workbench& bench, const CaseVariant& variant) {
  std::vector<Vec3f> shares[3];
  double farthest = 0;
  for (int i = 0; i < 3; ++i) {
    const float scale = i == 0 ? 1.0f : (i == 1 ? 0x1p-10f : 0x1p10f);
    SceneBuilder builder;
    builder.box(Vec3f(0), Vec3f(4, 3, 5) * scale, builder.material(Vec3f(0.5f)), true);
    const BuiltScene scene(builder.finish());
    Params params = exactParams("rtxgi");
    params.relocation = 1;
    const ProbeLayout layout = fullLattice({Vec3f(0.05f) * scale, Vec3f(3, 2, 4) * scale},
                                           Vec3i(3, 3, 3), scene.scene.bounds);
    const auto field = bench.field(scene, layout, params, variant);
    for (std::size_t p = 0; p < layout.positions.size(); ++p) {
      shares[i].push_back((field->states().positions[p] - layout.positions[p]) /
                          layout.lattice.spacing);
      for (std::size_t axis = 0; axis < 3; ++axis)
        farthest = larger(farthest, std::abs(static_cast<double>(shares[i].back()[axis])) /
                                        params.relocation_limit);
    }
  }
  return checked(
      shares[0] == shares[1] && shares[0] == shares[2] && farthest > 0.2 && farthest <= 1 + 1e-6,
      fmt::format("{} at three scales, at most {:.3g} of the limit",
                  shares[0] == shares[1] && shares[0] == shares[2] ? "the same bits" : "different",
                  farthest));
}

// A room whose outermost probes lie on its walls, edges and corners, or 5 cm from them, with
// relocation.
struct MovedProbes {
  explicit MovedProbes(double inset_m, int iterations = 5)
      : scene([] {
          SceneBuilder builder;
          builder.box(Vec3f(0), Vec3f(4, 3, 5),
                      builder.material(Vec3f(0.5f), Vec3f(0.2f, 1, 0.5f)), true);
          return builder.finish();
        }()),
        layout(fullLattice({Vec3f(static_cast<float>(inset_m)),
                            Vec3f(4, 3, 5) - Vec3f(static_cast<float>(inset_m))},
                           Vec3i(3, 3, 3), scene.scene.bounds)),
        params(exactParams("rtxgi")) {
    params.rays = 32;
    params.relocation = 1;
    params.relocation_iterations = iterations;
  }
  BuiltScene scene;
  ProbeLayout layout;
  Params params;
};

// Steps go back and forth where those to two walls take turns: a probe's last step, over a spacing.
Measurement relocationEnds(Workbench& bench, const CaseVariant& variant) {
  double step = 0;
  const MovedProbes shorter(0.05, 20), longer(0.05, 21);
  const auto a = bench.field(shorter.scene, shorter.layout, shorter.params, variant);
  const auto b = bench.field(longer.scene, longer.layout, longer.params, variant);
  for (std::size_t p = 0; p < shorter.layout.positions.size(); ++p)
    step = larger(step, static_cast<double>(length((b->states().positions[p] -
                                                    a->states().positions[p]) /
                                                   shorter.layout.lattice.spacing)));
  return within(step, 1e-3, "the 21st step, over a spacing:");
}

// What a moved probe has traced is what one traces that was placed there: nothing of its old place
// is left in texels, distances or answers.
Measurement relocatedHits(Workbench& bench, const CaseVariant& variant) {
  const MovedProbes place(0.05);
  const auto moved = bench.field(place.scene, place.layout, place.params, variant);
  ProbeLayout there = place.layout;
  there.positions = moved->states().positions;
  Params params = place.params;
  params.relocation = 0;
  const auto placed = bench.field(place.scene, there, params, variant);
  for (uint64_t u = 0; u < 3; ++u)
    for (ProbeField* field : {moved.get(), placed.get()}) field->update(u, {}, {});
  const std::vector<QueryPoint> points = randomPoints(place.scene.scene.bounds, 200, 3);
  const bool texels = moved->irradianceTexels() == placed->irradianceTexels() &&
                      moved->momentTexels() == placed->momentTexels();
  const bool answers = moved->query(points) == placed->query(points);
  const bool any = there.positions != place.layout.positions;
  return checked(any && texels && answers,
                 fmt::format("{}; texels {}, answers {}", any ? "moved" : "not moved",
                             texels ? "alike" : "differ", answers ? "alike" : "differ"));
}

// 26 of 27 probes lie 1 mm from walls, edges and corners. A step goes towards the farthest face, and
// [RTXGI] takes none where that one lies on the nearest one's side: in the middle of an edge.
Measurement relocatedOffWalls(Workbench& bench, const CaseVariant& variant) {
  MovedProbes place(0.001);
  place.params.classification = PL_CLASSIFY_INSIDE;
  const auto field = bench.field(place.scene, place.layout, place.params, variant);
  int moved = 0;
  for (const Vec3f& p : field->states().positions) {
    const Vec3f far = Vec3f(4, 3, 5) - p;
    moved += std::min(minComponent(p), minComponent(far)) > 0.05f ? 1 : 0;
  }
  convergeField(*field, {.average = 2});
  const double worst =
      worstError(field->query(randomPoints(place.scene.scene.bounds, 200, 3)), 2 * pi);
  if (!(worst <= 2e-4)) return within(worst, 2e-4, "E off by");
  const std::string text = fmt::format("{} of 26 stay nearer, E off by {:.2g}", 27 - moved, worst);
  return moved == 27 ? checked(true, text) : limitAt(27 - moved, text);
}

Measurement rotations(Workbench&, const CaseVariant&) {
  // Mean and second moment of a rotated unit vector: each component has variance 1/3, each product
  // of two at most 4/45; four standard errors of 4,096 rotations.
  constexpr int kRotations = 4096;
  Vec3d mean;
  double second[3][3] = {};
  for (uint64_t u = 0; u < kRotations; ++u) {
    const Vec3d v = randomRotation(1, u)[0];
    mean += v / static_cast<double>(kRotations);
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) second[i][j] += v[i] * v[j] / kRotations;
  }
  double worst = length(mean) / std::sqrt(3.0 / 3);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      worst = larger(worst, std::abs(second[i][j] - (i == j ? 1.0 / 3 : 0)) / std::sqrt(4.0 / 45));
  return within(worst * std::sqrt(kRotations), 4, "standard errors:");
}

// A map of random texels read on both sides of every place where the octahedron folds.
Measurement octahedralSeams(Workbench&, const CaseVariant& variant) {
  const int border = variant.format == "border" ? 1 : 0;
  double worst = 0;
  for (const int n : {6, 8, 14}) {
    Rng rng(5, RngStream::stability);
    std::vector<double> inside(static_cast<std::size_t>(n * n));
    for (double& t : inside) t = rng.nextDouble();
    const auto read = [&](const Vec2d& e) {
      const OctTaps<double> taps = mapTaps(e, n, border);
      const auto texel = [&](int place) {
        if (border == 0) return inside[static_cast<std::size_t>(place)];
        // A border texel holds the interior one with which the map goes on.
        const int x = place % (n + 2) - 1, y = place / (n + 2) - 1;
        return inside[static_cast<std::size_t>(tileTexel(x, y, n, 0))];
      };
      const double top =
          texel(taps.texel_00) * (1 - taps.fraction_x) + texel(taps.texel_10) * taps.fraction_x;
      const double bottom =
          texel(taps.texel_01) * (1 - taps.fraction_x) + texel(taps.texel_11) * taps.fraction_x;
      return top * (1 - taps.fraction_y) + bottom * taps.fraction_y;
    };
    // An edge of the map runs along itself backwards: (1, y) and (1, -y) are one direction.
    for (int i = 0; i <= 1000; ++i) {
      const double y = i / 500.0 - 1;
      for (const double side : {-1.0, 1.0}) {
        worst = larger(worst, std::abs(read({side, y}) - read({side, -y})));
        worst = larger(worst, std::abs(read({y, side}) - read({-y, side})));
      }
    }
  }
  return within(worst, 1e-12, "largest jump");
}

}  // namespace

std::vector<StabilityCase> probeCases() {
  const auto tracers = bothTracers();
  return {
      {"probe.inside_solid", "probes inside a wall",
       "inactive, weight 0: E of each room within 1e-5", "G23 P9", tracers, insideSolid},
      {"probe.all_inside", "every probe inside a wall", "error", "G23 P9", {}, allInside},
      {"probe.on_surface", "probes on walls, edges and corners",
       "of the closed form, at least a sixteenth (an octant) and never more", "G24 P9", tracers,
       onSurface},
      {"probe.beside_surface", "probes nearer and nearer to walls",
       "E = pi Le / (1 - albedo) within 2e-4 at any distance above 0", "G24 P9", tracers,
       besideSurface},
      {"probe.all_occluded",
       "all eight probes occluded",
       "no answer from the walls' other side: 0, or the fallback's; counted",
       "G25 P9",
       {{"", "none"}, {"", "nearest"}},
       allOccluded},
      {"probe.floor_leak",
       "what occluded probes keep of their weight",
       "a floor of 0: below 1e-6; floors of published presets: 0.45 % at equal distances",
       "G25 P10",
       {{"", "probelab"}, {"", "rtxgi"}},
       floorLeak},
      {"probe.coincident", "spacing 0", "error", "G26", {}, coincident},
      {"probe.single", "a lattice of 1 x 1 x 1", "that probe's value everywhere (1e-6)", "G27",
       tracers, singleProbe},
      {"probe.none", "no probe", "error", "G28", {}, noProbe},
      {"probe.sees_nothing", "no surface in sight",
       "the sky's irradiance within 1e-5, depth at the clamp", "G29", tracers, seesNothing},
      {"probe.too_many", "2^31 texels", "error before anything is allocated", "G30", {}, tooMany},
      {"probe.relocation", "rooms a thousandth and a thousand times as large",
       "moved by the same share of a spacing, within the limit", "P14", tracers, relocation},
      {"probe.relocation_ends", "a twenty-first step of relocation",
       "at most 1e-3 of a spacing: nothing goes back and forth", "P14", tracers, relocationEnds},
      {"probe.relocated_hits", "moved probes against probes placed there",
       "the same bits in texels, distances and answers", "P14", tracers, relocatedHits},
      {"probe.relocated_off_walls", "relocation of probes 1 mm from walls, edges and corners",
       "5 cm away after 5 steps, E = pi Le / (1 - albedo) within 2e-4", "G24 P9", tracers,
       relocatedOffWalls},
      {"probe.rotations",
       "random rotations of the rays",
       "mean 0 and second moment 1/3 within 4 standard errors",
       "P17",
       {},
       rotations},
      {"probe.octahedral_seams",
       "folds of the octahedral map",
       "both sides of every fold read the same, 1e-12",
       "P16",
       {{"", "border"}, {"", "no_border"}},
       octahedralSeams},
  };
}

}  // namespace probelab
