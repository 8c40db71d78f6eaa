// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles that should not be there, lie on each other, face the wrong way or are missing.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/rng.h"
#include "cases.h"
#include "closed_forms.h"
#include "hostile_files.h"

namespace probelab {
namespace {

using std::numbers::pi;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

Measurement nonFiniteVertex(Workbench& bench, const CaseVariant&) {
  const auto load = [&](float y) { loadTiny(bench, TinyGltf({0, 0, 0, 1, 0, 0, 0, y, 0})); };
  load(1);  // the number alone makes the others wrong
  Measurement result;
  for (const float bad : {kNan, kInf, -kInf}) {
    result = refused([&] { load(bad); }, {"mesh 'seat'", "element 2"});
    if (result.verdict != Verdict::holds) return result;
  }
  result.text = "3 refused; " + result.text;
  return result;
}

Measurement farVertex(Workbench& bench, const CaseVariant&) {
  const Measurement fine = checked(
      loadTiny(bench, TinyGltf({0, 0, 0, 1, 0, 0, 0, 9e6f, 0})).geometry->triangles.size() == 1,
      "9e6 m loads");
  return both(fine, refused(
                        [&] {
                          loadTiny(bench, TinyGltf({0, 0, 0, 1, 0, 0, 0, 2e7f, 0}));
                        },
                        {"mesh 'seat'", "vertex 2", "beyond 10000000"}));
}

// Hits of rays at a triangle, with two triangles without an area beside it.
Measurement zeroArea(Workbench& bench, const CaseVariant&) {
  const BuiltScene clean(loadTiny(bench, TinyGltf()));
  const BuiltScene dirty(
      loadTiny(bench, TinyGltf({0, 0, 0, 1, 0, 0, 0, 1, 0, 2, 0, 0}, {0, 1, 2, 0, 0, 1, 0, 1, 3})));
  const Geometry& geometry = *dirty.scene.geometry;
  bool same = geometry.triangles.size() == 1 && geometry.dropped_degenerate == 2 &&
              !dirty.scene.warnings.empty();
  Rng rng(1, RngStream::stability);
  const Vec3d moved = clean.scene.origin - dirty.scene.origin;
  for (int i = 0; i < 1000; ++i) {
    const Vec3f from(rng.nextFloat() - 0.5f, rng.nextFloat() - 0.5f, 1);
    const Hit a = clean.embree.closest(Ray{from, 0, Vec3f(0, 0, -1), 10});
    const Hit b = dirty.embree.closest(Ray{Vec3f(Vec3d(from) + moved), 0, Vec3f(0, 0, -1), 10});
    same = same && (a.primitive == kNoHit) == (b.primitive == kNoHit) &&
           (a.primitive == kNoHit || std::abs(a.t - b.t) <= 1e-6f);
  }
  return checked(same, fmt::format("{} dropped, {} kept, {} warnings, 1000 rays alike",
                                   geometry.dropped_degenerate, geometry.triangles.size(),
                                   dirty.scene.warnings.size()));
}

// A triangle of 1e-20 m in a corner of a furnace, and rays from everywhere at it.
Measurement tinyTriangle(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f), Vec3f(1));
  builder.box(Vec3f(0), Vec3f(2), m, true);
  builder.triangle(Vec3f(0), Vec3f(1e-20f, 0, 0), Vec3f(0, 1e-20f, 0), m);
  const BuiltScene scene(builder.finish());
  Rng rng(2, RngStream::stability);
  std::vector<Ray> rays;
  for (int i = 0; i < 2000; ++i) {
    const Vec3f from(rng.nextFloat() * 2, rng.nextFloat() * 2, rng.nextFloat() * 2);
    rays.push_back({from, 0, normalize(from * -1.0f), 100});
  }
  rays.push_back({Vec3f(0), 0, Vec3f(1, 0, 0), 100});  // starts on it
  int odd = 0;
  for (const Hit& hit : bench.closest(scene, rays, variant))
    if (!(hit.t >= 0) || !std::isfinite(hit.u) || !std::isfinite(hit.v)) ++odd;
  const bool dropped =
      loadTiny(bench, TinyGltf({0, 0, 0, 1, 0, 0, 0, 1, 0, 1e-20f, 0, 0, 0, 1e-20f, 0},
                               {0, 1, 2, 0, 3, 4}))
          .geometry->dropped_degenerate == 1;
  return checked(odd == 0 && dropped, fmt::format("{} of {} hits not finite, {} by the loader", odd,
                                                  rays.size(), dropped ? "dropped" : "kept"));
}

Measurement indexOutOfRange(Workbench& bench, const CaseVariant&) {
  return refused(
      [&] {
        loadTiny(bench, TinyGltf({0, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 1, 3}));
      },
      {"mesh 'seat'", "index 3", "out of range"});
}

// Six walls, `copies` of every triangle, emitting or under a point light.
Answers copiedRoom(Workbench& bench, const CaseVariant& variant, int copies, bool emitting) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f), Vec3f(emitting ? 1.0f : 0.0f));
  for (int i = 0; i < copies; ++i) builder.box(Vec3f(0), Vec3f(2), m, true);
  if (!emitting) builder.pointLight(Vec3f(0.9f, 1.3f, 1.1f), Vec3f(1));
  const BuiltScene scene(builder.finish());
  Params params = exactParams("rtxgi");
  params.rays = 64;
  return answersAt(bench, scene, furnaceLayout(scene.scene), params, furnacePoints(), variant);
}

Measurement duplicateWalls(Workbench& bench, const CaseVariant& variant) {
  return near(copiedRoom(bench, variant, 2, false), copiedRoom(bench, variant, 1, false), 1e-5);
}

Measurement duplicateEmitters(Workbench& bench, const CaseVariant& variant) {
  return near(copiedRoom(bench, variant, 2, true), copiedRoom(bench, variant, 1, true), 1e-5);
}

// A floor of two materials in one place, and of each alone.
Measurement coplanarAlbedo(Workbench& bench, const CaseVariant& variant) {
  const auto answer = [&](std::initializer_list<float> floors) {
    SceneBuilder builder;
    builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0.5f), Vec3f(1)), true);
    for (const float albedo : floors)
      builder.quad(Vec3f(0, 0.1f, 0), Vec3f(0, 0.1f, 2), Vec3f(2, 0.1f, 2), Vec3f(2, 0.1f, 0),
                   builder.material(Vec3f(albedo)));
    const BuiltScene scene(builder.finish());
    Params params = exactParams("rtxgi");
    params.rays = 64;
    const auto field = bench.field(scene, furnaceLayout(scene.scene), params, variant);
    for (uint64_t u = 0; u < 3; ++u) field->update(u, {}, {});
    const std::vector<QueryPoint> ceiling{{Vec3f(1, 2, 1), Vec3f(0, -1, 0), Vec3f(0, 1, 0)}};
    return field->query(ceiling).front().y;
  };
  const float dark = answer({0.2f}), bright = answer({0.8f});
  const float first = answer({0.2f, 0.8f}), again = answer({0.2f, 0.8f});
  return checked(first == again && first >= dark && first <= bright,
                 fmt::format("{:.4g} twice, alone {:.4g} and {:.4g}", first, dark, bright));
}

// Rays from inside a closed sphere at its vertices and edges; shares that get out.
Measurement vertexRays(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.sphere(Vec3f(0), 1, 3, builder.material(Vec3f(0.5f)), true);
  const BuiltScene scene(builder.finish());
  const Geometry& g = *scene.scene.geometry;
  Rng rng(3, RngStream::stability);
  constexpr std::size_t kRays = 20000;
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < 3 * kRays; ++i) {
    const Vec3f from = randomDirection(rng) * (0.8f * rng.nextFloat());
    const Triangle& t = g.triangles[rng.nextBelow(g.triangles.size())];
    const float along = i < kRays ? 0.0f : rng.nextFloat();
    Vec3f to = g.positions[t.vertex[0]] * (1 - along) + g.positions[t.vertex[1]] * along;
    if (i >= 2 * kRays) to = randomDirection(rng);
    rays.push_back({from, 0, normalize(to - from), 100});
  }
  const std::vector<Hit> hits = bench.closest(scene, rays, variant);
  double escaped[3] = {};
  for (std::size_t i = 0; i < hits.size(); ++i)
    if (hits[i].primitive == kNoHit) escaped[i / kRays] += 1.0 / kRays;
  const std::string text =
      fmt::format("escapes: vertices {:.2g} %, edges {:.2g} %, random {:.2g} %", 100 * escaped[0],
                  100 * escaped[1], 100 * escaped[2]);
  if (escaped[1] > 0 || escaped[2] > 0) return checked(false, text);
  // How a device treats a ray through a vertex is its own affair.
  if (escaped[0] > 0.005 && variant.tracer == "rayquery") return limitAt(escaped[0], text);
  return checked(escaped[0] <= 0.005, text);
}

Params quickParams() {
  Params params = exactParams("probelab");
  params.rays = 64;
  return params;
}

Measurement invertedNormals(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0.5f), Vec3f(1)), false);
  const BuiltScene scene(builder.finish());
  const std::vector<QueryPoint> air{upAt(Vec3f(1)), upAt(Vec3f(0.5f, 1.4f, 0.7f))};
  double most = 0;
  for (const double e :
       answersAt(bench, scene, furnaceLayout(scene.scene), quickParams(), air, variant).e)
    most = larger(most, std::abs(e));
  return within(most, 0, "largest E");
}

// Without the wall at z = 0, and with a fin that makes an edge of three faces; black, so that E is
// pi less what the opening takes.
Measurement openBox(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0), Vec3f(1));
  builder.box(Vec3f(0), Vec3f(2), m, true);
  builder.geometry().triangles.resize(builder.geometry().triangles.size() - 2);
  builder.quad(Vec3f(0), Vec3f(2, 0, 0), Vec3f(2, 0.2f, 0.2f), Vec3f(0, 0.2f, 0.2f), m);
  const BuiltScene scene(builder.finish());
  if (variant.tracer != "reference") {
    const double worst = probeError(bench, scene, variant, [](const Vec3d& w) {
      return w.z < 0 && -w.z >= std::max(std::abs(w.x), std::abs(w.y)) ? 0.0 : 1.0;
    });
    // The opening's edges are 4 arcs of acos(1/3) in which 4 acos(1/3) / sqrt(stratum) rays stand
    // for strata that are cut: four deviations of as many uniform shares.
    const double cut = 4 * std::acos(1.0 / 3) / std::sqrt(kProbeStratum);
    return within(worst, 4 * std::sqrt(cut / 12) * kProbeStratum, "E of a probe off by");
  }
  // From (1,1,1) the fin is seen edge-on; from (1,0,1) it hides the opening up to y = 0.25.
  const std::vector<QueryPoint> points{upAt(Vec3f(1)), upAt(Vec3f(1, 0, 1))};
  std::vector<double> truth;
  for (const auto& [height, lowest] : {std::pair(1.0, 1.0), std::pair(0.0, 0.25)}) {
    const Vec3d corners[] = {{0, lowest, 0}, {2, lowest, 0}, {2, 2, 0}, {0, 2, 0}};
    truth.push_back(pi - polygonIrradiance(corners, Vec3d(1, height, 1), Vec3d(0, 1, 0)));
  }
  return near(answersAt(bench, scene, {}, {}, points, variant, {.samples = 65536}), truth, 0);
}

// A furnace with three fins on one edge that lies in its floor, two of them in one place. Both sides
// of everything emit, so that E is pi everywhere.
Measurement sharedEdge(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0), Vec3f(1), true);
  builder.box(Vec3f(0), Vec3f(2), m, true);
  for (const float lean : {0.4f, 0.9f, 0.9f})
    builder.quad(Vec3f(0, 0, 0.5f), Vec3f(2, 0, 0.5f), Vec3f(2, 0.6f, lean), Vec3f(0, 0.6f, lean),
                 m);
  const BuiltScene scene(builder.finish());
  const std::vector<QueryPoint> points{upAt(Vec3f(1)), upAt(Vec3f(1, 0.05f, 0.55f)),
                                       upAt(Vec3f(0.3f, 0, 0.5f)), upAt(Vec3f(1.7f, 0.7f, 0.2f))};
  return near(answersAt(bench, scene, furnaceLayout(scene.scene), quickParams(), points, variant,
                        {.updates = 1}),
              std::vector<double>(points.size(), pi), 1e-5);
}

Measurement fewTriangles(Workbench& bench, const CaseVariant& variant) {
  Measurement result;
  for (const bool triangle : {false, true}) {
    SceneBuilder builder;
    builder.scene().sky.radiance = Vec3f(0.7f);
    builder.scene().bounds = {Vec3f(0), Vec3f(2)};
    // Behind all normals, and too small for a ray to find it.
    if (triangle)
      builder.triangle(Vec3f(0, -9, 0), Vec3f(0, -9, 1e-3f), Vec3f(1e-3f, -9, 0),
                       builder.material(Vec3f(0.5f)));
    const BuiltScene scene(builder.finish());
    const std::vector<QueryPoint> points{upAt(Vec3f(1)), upAt(Vec3f(0.4f, 1.9f, 0.2f))};
    const Box3f& b = scene.scene.bounds;
    const Measurement one = near(answersAt(bench, scene, fullLattice(b, Vec3i(2, 2, 2), b),
                                           quickParams(), points, variant, {.updates = 1}),
                                 std::vector<double>(2, pi * static_cast<double>(0.7f)), 1e-5);
    result = triangle ? both(result, one) : one;
  }
  return result;
}

}  // namespace

std::vector<StabilityCase> geometryCases() {
  const auto tracers = bothTracers();
  const auto all = bothTracersAndReference();
  return {
      {"geometry.non_finite_vertex",
       "NaN or infinite vertex",
       "error naming mesh and vertex (Embree would drop it silently)",
       "G1",
       {},
       nonFiniteVertex},
      {"geometry.far_vertex",
       "coordinate beyond 1e7 m",
       "error naming mesh and vertex; below it loads",
       "G2",
       {},
       farVertex},
      {"geometry.zero_area",
       "triangles without an area",
       "dropped, counted, warned; hits unchanged",
       "G3",
       {},
       zeroArea},
      {"geometry.tiny_triangle", "triangle of 1e-20 m", "dropped by the loader; no hit at t = NaN",
       "G4", tracers, tinyTriangle},
      {"geometry.index_range",
       "index beyond the vertices",
       "error naming mesh and index",
       "G5",
       {},
       indexOutOfRange},
      {"geometry.duplicate_walls", "every triangle twice, lamp",
       "E as with one: 1e-5 (equal hits); reference 5 standard errors", "G6", all, duplicateWalls},
      {"geometry.duplicate_emitters", "every triangle twice, emitting",
       "E as with one: 1e-5 (equal hits); reference 5 standard errors", "G6", all,
       duplicateEmitters},
      {"geometry.coplanar_albedo", "floors of two albedos in one plane",
       "the same bits twice, between the two alone", "G7", tracers, coplanarAlbedo},
      {"geometry.vertex_rays", "rays at vertices and edges of a closed sphere",
       "escapes at most 0.5 % at vertices (robust mode: 0.26 %), 0 elsewhere", "G10", tracers,
       vertexRays},
      {"geometry.inverted_normals", "an emitting room turned inside out",
       "back faces are black and do not emit: E = 0", "G12", all, invertedNormals},
      {"geometry.open_box", "box without a lid, edge of three faces",
       "E = pi less Lambert's formula of the opening: reference 5 sigma, probe 4 of its cut strata",
       "G13", all, openBox},
      {"geometry.shared_edge", "fins on one edge of a furnace, one of them twice",
       "E = pi: reference 5 sigma, fields within 1e-5", "G13", all, sharedEdge},
      {"geometry.few_triangles", "no triangle, or one, under a sky", "E = pi L within 1e-5", "G14",
       all, fewTriangles},
  };
}

}  // namespace probelab
