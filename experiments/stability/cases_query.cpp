// SPDX-License-Identifier: GPL-3.0-or-later
// Questions asked at probes, on cell faces, far away, in corners, with odd normals and NaN.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "cases.h"

namespace probelab {
namespace {

using std::numbers::pi;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

std::vector<CaseVariant> presets() {
  return {{"", "gdc2019"}, {"", "majercik2021"}, {"", "rtxgi"}, {"", "probelab"}};
}

// A room of 4 x 2 x 2 m, lit from one end, with a pillar where asked for; its lattice.
Scene litRoom(bool pillar) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(4, 2, 2), builder.material(Vec3f(0.5f)), true);
  builder.box(Vec3f(0.05f, 0.3f, 0.3f), Vec3f(0.15f, 1.7f, 1.7f),
              builder.material(Vec3f(0.2f), Vec3f(1, 2, 3)), false);
  if (pillar)
    builder.box(Vec3f(1.7f, 0, 0.7f), Vec3f(2.3f, 2, 1.3f), builder.material(Vec3f(0.4f)), false);
  return builder.finish();
}
ProbeLayout litLayout(const Scene& scene) {
  return fullLattice({Vec3f(0.4f, 0.3f, 0.3f), Vec3f(3.6f, 1.7f, 1.7f)}, Vec3i(6, 3, 3),
                     scene.bounds);
}

Measurement atProbe(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.5f, 1));
  Params params = exactParams(variant.format);
  params.normal_bias = params.view_bias = 0;
  const ProbeLayout layout = furnaceLayout(scene.scene);
  const auto field = bench.field(scene, layout, params);
  field->update(0, {}, {});
  std::vector<QueryPoint> points;
  for (const Vec3f& p : layout.positions) points.push_back(upAt(p));
  return within(worstError(field->query(points), pi), 1e-5, "error");
}

Measurement oddNormals(Workbench& bench, const CaseVariant&) {
  const BuiltScene scene(litRoom(true));
  const auto field = bench.field(scene, litLayout(scene.scene), exactParams("rtxgi"));
  field->update(0, {}, {});
  const std::vector<QueryPoint> unit = randomPoints({Vec3f(0.3f), Vec3f(3.7f, 1.7f, 1.7f)}, 100, 9);
  const std::vector<Vec4f> expected = field->query(unit);
  double worst = 0;
  for (const float k : {1e-3f, 0.5f, 7.0f, 1e6f}) {
    std::vector<QueryPoint> longer = unit;
    for (QueryPoint& p : longer) p.normal = p.normal * k;
    worst = larger(worst, worstDifference(field->query(longer), expected));
  }
  // A unit vector is one within 2^-22 after scaling and normalising.
  return within(worst, 1e-5, "difference");
}

// Normals of 0 or NaN, NaN and infinite places.
Measurement notANumber(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(litRoom(true));
  const auto field = bench.field(scene, litLayout(scene.scene), exactParams(variant.format));
  field->update(0, {}, {});
  const Vec3f up(0, 1, 0), middle(1, 1, 1);
  const std::vector<QueryPoint> points{
      {middle, Vec3f(0), up},          {middle, Vec3f(kNan), up}, {Vec3f(kNan), up, up},
      {Vec3f(1, kInf, 1), up, up},     {middle, up, Vec3f(kNan)}, {Vec3f(-kInf, 1, kNan), up, up},
      {middle, Vec3f(0, kInf, 0), up}, {middle, up, up * -1.0f}};
  const uint32_t before = field->counters().fallback_queries;
  const std::vector<Vec4f> answers = field->query(points);
  bool zero = true;
  for (std::size_t i = 0; i + 1 < points.size(); ++i)
    zero = zero && answers[i].x == 0 && answers[i].y == 0 && answers[i].z == 0;
  const uint32_t counted = field->counters().fallback_queries - before;
  return checked(
      zero && counted == points.size() - 1 && answers.back().y > 0,
      fmt::format("{}, {} of {} counted", zero ? "0" : "not 0", counted, points.size() - 1));
}

Measurement outside(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.scene().sky.radiance = Vec3f(1);
  builder.scene().bounds = {Vec3f(-2), Vec3f(2)};
  const BuiltScene scene(builder.finish());
  const auto field =
      bench.field(scene, fullLattice({Vec3f(-1), Vec3f(1)}, Vec3i(5, 5, 5), scene.scene.bounds),
                  exactParams(variant.format));  // s_i = 0.5 m
  field->update(0, {}, {});
  std::vector<QueryPoint> points;
  std::vector<double> weights;
  for (const double d : {-0.3, 0.0, 0.1, 0.25, 0.4, 0.5, 0.8, 1e3, 1e30}) {
    const double weight = std::clamp(1 - d / 0.5, 0.0, 1.0);
    const auto out = static_cast<float>(2 + d);
    points.push_back(upAt(Vec3f(out, 0.3f, 0)));
    weights.push_back(weight);
    points.push_back(upAt(Vec3f(0.1f, -out, -out)));
    weights.push_back(weight * weight);
  }
  double worst = 0;
  const std::vector<Vec4f> answers = field->query(points);
  for (std::size_t i = 0; i < points.size(); ++i)
    worst = larger(worst, std::abs(static_cast<double>(answers[i].y) / pi - weights[i]));
  return within(worst, 1e-5, "error");
}

Measurement negativeCoordinates(Workbench& bench, const CaseVariant&) {
  Scene room = litRoom(false);
  room.bounds = {Vec3f(-40), Vec3f(40)};
  const BuiltScene scene(std::move(room));
  const auto field = bench.field(scene, litLayout(scene.scene), exactParams("classic"));
  field->update(0, {}, {});
  const std::vector<QueryPoint> far{upAt(Vec3f(-30, 1, 1)), upAt(Vec3f(30, 1, 1))};
  const std::vector<QueryPoint> ends{upAt(Vec3f(0.4f, 1, 1)), upAt(Vec3f(3.6f, 1, 1))};
  return within(worstDifference(field->query(far), field->query(ends)), 1e-5, "difference");
}

// Largest jump across the lattice's planes, over the largest answer: 1e-6 of a spacing on each
// side.
double largestJump(Workbench& bench, bool pillar, const Params& params) {
  const BuiltScene scene(litRoom(pillar));
  const ProbeLayout layout = litLayout(scene.scene);
  const auto field = bench.field(scene, layout, params);
  field->update(0, {}, {});
  std::vector<QueryPoint> low =
      randomPoints({Vec3f(0.45f, 0.35f, 0.35f), Vec3f(3.55f, 1.65f, 1.65f)}, 2000, 10);
  std::vector<QueryPoint> high = low;
  for (std::size_t i = 0; i < low.size(); ++i) {
    const std::size_t axis = i % 3;
    const float first = layout.lattice.first[axis], spacing = layout.lattice.spacing[axis];
    // The biased position is what lies on a plane.
    const Vec3f bias = (low[i].normal * static_cast<float>(params.normal_bias) -
                        low[i].view * static_cast<float>(params.view_bias)) *
                       layout.bias_length_m;
    const float plane = first + spacing * std::round((low[i].position[axis] - first) / spacing);
    low[i].position[axis] = plane - bias[axis] - 1e-6f * spacing;
    high[i].position[axis] = plane - bias[axis] + 1e-6f * spacing;
  }
  return worstDifference(field->query(low), field->query(high));
}

Params plainInterpolation() {
  Params params = exactParams("rtxgi");
  params.trilinear_floor = 0;
  return params;
}

Measurement cellFaces(Workbench& bench, const CaseVariant& variant) {
  if (variant.format == "plain")
    return within(largestJump(bench, false, plainInterpolation()), 1e-5, "jump");
  const Params params = exactParams(variant.format);
  const double jump = largestJump(bench, false, params);
  if (jump <= 1e-5) return within(jump, 1e-5, "jump");
  // The floor keeps 0.001 of a probe that leaves the cell: no more than that can jump where all are
  // visible, times how much dearer it may be by its facing (1.2 to 0.2).
  const double bound = params.trilinear_floor * 6;
  if (jump > bound) return within(jump, bound, "jump");
  return limitAt(jump, fmt::format("jumps of {:.2g} at cell faces, floor of {:.0e}", jump,
                                   params.trilinear_floor));
}

Measurement tinyWeights(Workbench& bench, const CaseVariant& variant) {
  const Params params =
      variant.format == "plain" ? plainInterpolation() : exactParams(variant.format);
  const double jump = largestJump(bench, true, params);
  if (jump <= 1e-5) return within(jump, 1e-5, "jump");
  return limitAt(jump, fmt::format("jumps of {:.2g} beside the pillar", jump));
}

// A furnace's wall points as near to a corner as asked, normals of each wall that meets there.
std::vector<QueryPoint> cornerPoints(float distance) {
  std::vector<QueryPoint> points;
  for (const float other : {distance, 1.0f}) {
    points.push_back(upAt(Vec3f(distance, 0, other)));
    points.push_back({Vec3f(0, distance, other), Vec3f(1, 0, 0), Vec3f(-1, 0, 0)});
    points.push_back({Vec3f(2 - distance, other, 2), Vec3f(0, 0, -1), Vec3f(0, 0, 1)});
  }
  return points;
}

Measurement corners(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.5f, 1));
  if (variant.tracer != "reference") {
    Params params = exactParams("rtxgi");
    params.rays = 32;
    const auto field = bench.field(scene, furnaceLayout(scene.scene), params, variant);
    convergeField(*field, {.average = 2});
    return within(worstError(field->query(cornerPoints(0)), pi / 0.5), 2e-4, "error");
  }
  const auto holds = [&](double inverse) {
    const std::vector<QueryPoint> points = cornerPoints(static_cast<float>(1 / inverse));
    return near(answersAt(bench, scene, {}, {}, points, variant, {.samples = 512}),
                std::vector<double>(points.size(), pi / 0.5), 0)
               .verdict == Verdict::holds;
  };
  const double nearest = 1 / breakingPoint(10, 1e9, holds, 0.1);
  if (nearest <= 1.1e-9) return checked(true, "holds 1 nm from an edge");
  return limitAt(nearest,
                 fmt::format("holds down to {:.2g} m from an edge of a 2 m room", nearest));
}

}  // namespace

std::vector<StabilityCase> queryCases() {
  return {
      {"query.at_probe", "a query at a probe's very place", "E = pi L within 1e-5", "G35",
       presets(), atProbe},
      {"query.odd_normals",
       "normals of length 1e-3 to 1e6",
       "as for unit ones within 1e-5",
       "G36",
       {},
       oddNormals},
      {"query.not_a_number",
       "normals of 0, NaN; places NaN, infinite",
       "0 and counted, nothing read out of range",
       "G36 G39",
       {{"", "rtxgi"}, {"", "probelab"}},
       notANumber},
      {"query.outside", "outside the bounds, to 1e30 m",
       "the weight falls linearly to 0 over one s_i, on each axis", "G37", presets(), outside},
      {"query.negative",
       "30 m below the first probe",
       "clamped to the lattice, never wrapped",
       "P21",
       {},
       negativeCoordinates},
      {"query.cell_faces",
       "both sides of the cells' faces",
       "no jump above 1e-5 of the largest E",
       "G38",
       {{"", "plain"}, {"", "rtxgi"}, {"", "probelab"}},
       cellFaces},
      {"query.tiny_weights",
       "cell faces behind a pillar, where probes lose all but their floor",
       "no jump above 1e-5 of the largest E",
       "P23",
       {{"", "plain"}, {"", "rtxgi"}, {"", "majercik2021"}, {"", "probelab"}},
       tinyWeights},
      {"query.corners", "receivers on edges and in corners",
       "E = pi Le / (1 - albedo) within 2e-4; reference 5 sigma to 1 nm from the edge", "",
       bothTracersAndReference(), corners},
  };
}

}  // namespace probelab
