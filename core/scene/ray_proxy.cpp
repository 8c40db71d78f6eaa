// SPDX-License-Identifier: Apache-2.0
#include "scene/ray_proxy.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <span>

#include "base/error.h"
#include "base/parallel.h"
#include "base/timer.h"
#include "proxy_decimate.h"
#include "proxy_error.h"
#include "proxy_patch.h"

namespace probelab {
namespace {

// A run of a mesh range's triangles of one material.
struct Part {
  std::string mesh;
  uint32_t material = 0;
  std::vector<uint32_t> triangles;
  std::vector<std::optional<Corners>> after;  // [triangle of the part]
  ProxyError error;
  const char* left_alone = nullptr;  // why
};

void addRun(const Geometry& geometry, const std::string& mesh, uint32_t first, uint32_t end,
            std::vector<Part>& parts) {
  const std::size_t start = parts.size();
  for (uint32_t t = first; t < end; ++t) {
    const uint32_t material = geometry.triangles[t].material;
    auto part = std::find_if(parts.begin() + start, parts.end(),
                             [&](const Part& p) { return p.material == material; });
    if (part == parts.end()) {
      parts.emplace_back();
      part = parts.end() - 1;
      part->mesh = mesh, part->material = material;
    }
    part->triangles.push_back(t);
  }
}

// Every triangle belongs to one part, also those that no mesh range names.
std::vector<Part> makeParts(const Geometry& geometry) {
  std::vector<Part> parts;
  std::vector<const MeshRange*> ranges;
  for (const MeshRange& range : geometry.meshes) ranges.push_back(&range);
  std::stable_sort(ranges.begin(), ranges.end(), [](const MeshRange* a, const MeshRange* b) {
    return a->first_triangle < b->first_triangle;
  });
  const auto count = static_cast<uint32_t>(geometry.triangles.size());
  uint32_t done = 0;
  for (const MeshRange* range : ranges) {
    const uint32_t first = std::min(std::max(range->first_triangle, done), count);
    const uint64_t last = uint64_t{range->first_triangle} + range->triangle_count;
    const auto end = static_cast<uint32_t>(std::clamp<uint64_t>(last, first, count));
    addRun(geometry, "unnamed", done, first, parts);
    addRun(geometry, range->name, first, end, parts);
    done = end;
  }
  addRun(geometry, "unnamed", done, count, parts);
  return parts;
}

// [position] where triangles of several parts meet.
std::vector<bool> findShared(const Geometry& geometry, const std::vector<Part>& parts,
                             const std::vector<uint32_t>& welded) {
  std::vector<int64_t> owner(geometry.positions.size(), -1);
  std::vector<bool> shared(geometry.positions.size());
  for (std::size_t p = 0; p < parts.size(); ++p)
    for (const uint32_t t : parts[p].triangles)
      for (const uint32_t vertex : geometry.triangles[t].vertex) {
        int64_t& mine = owner[welded[vertex]];
        if (mine >= 0 && mine != static_cast<int64_t>(p)) shared[welded[vertex]] = true;
        mine = static_cast<int64_t>(p);
      }
  return shared;
}

struct UvSets {
  bool first = false, second = false;
};

UvSets usedUvSets(const Material& material) {
  UvSets sets;
  for (const TextureUse* use :
       {&material.base_color_texture, &material.metallic_texture, &material.emission_texture})
    if (use->used()) (use->uv_set == 0 ? sets.first : sets.second) = true;
  return sets;
}

// [corner of the part] one index for all vertices with the same position and attributes, by bits.
std::vector<Corners> mergeCorners(const Geometry& geometry, const Part& part,
                                  const std::vector<uint32_t>& welded, const UvSets& uv) {
  using Key = std::array<uint32_t, 9>;
  const auto bits = [](float x) { return std::bit_cast<uint32_t>(x + 0.0f); };
  const auto key = [&](uint32_t v) {
    Key k{welded[v], 0, 0, 0, 0, 0, 0, 0, v};
    if (!geometry.normals.empty())
      for (std::size_t c = 0; c < 3; ++c) k[1 + c] = bits(geometry.normals[v][c]);
    if (uv.first && !geometry.uv0.empty())
      k[4] = bits(geometry.uv0[v].x), k[5] = bits(geometry.uv0[v].y);
    if (uv.second && !geometry.uv1.empty())
      k[6] = bits(geometry.uv1[v].x), k[7] = bits(geometry.uv1[v].y);
    return k;
  };
  std::vector<std::pair<Key, uint32_t>> keys;  // and 3 * triangle of the part + corner
  for (uint32_t i = 0; i < 3 * part.triangles.size(); ++i)
    keys.emplace_back(key(geometry.triangles[part.triangles[i / 3]].vertex[i % 3]), i);
  std::sort(keys.begin(), keys.end());
  std::vector<Corners> corners(part.triangles.size());
  uint32_t merged = 0;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const auto& [k, corner] = keys[i];
    if (i == 0 || !std::equal(k.begin(), k.end() - 1, keys[i - 1].first.begin())) merged = k.back();
    corners[corner / 3][corner % 3] = merged;
  }
  return corners;
}

std::vector<Corners> remaining(const std::vector<std::optional<Corners>>& after) {
  std::vector<Corners> faces;
  for (const auto& face : after)
    if (face) faces.push_back(*face);
  return faces;
}

struct Build {
  const Scene& scene;
  const RayProxyOptions& options;
  const std::vector<uint32_t>& welded;
  const std::vector<bool>& shared;
};

bool areaHolds(const Build& build, const Part& part) {
  if (maxComponent(build.scene.materials[part.material].emission) == 0) return true;
  return std::abs(part.error.area_after_m2 - part.error.area_before_m2) <=
         build.options.max_emitter_area_change * part.error.area_before_m2;
}

// Decimates, measures, and starts again with less tolerance while the measured error is too large:
// ModHausdorff bounds the distance at the vertices that go, not between them.
void decimatePart(const Build& build, Part& part) {
  const Geometry& geometry = *build.scene.geometry;
  std::vector<Corners> before, welded_faces;
  for (const uint32_t t : part.triangles) {
    const auto& v = geometry.triangles[t].vertex;
    before.push_back({v[0], v[1], v[2]});
    welded_faces.push_back({build.welded[v[0]], build.welded[v[1]], build.welded[v[2]]});
    for (const uint32_t vertex : v)
      if (!isFinite(geometry.positions[vertex])) part.left_alone = "positions are not finite";
  }
  const auto leaveAlone = [&] { part.after.assign(before.begin(), before.end()); };
  leaveAlone();
  if (part.left_alone) return;
  const Patch patch = makePatch(welded_faces, geometry.positions, build.shared);
  if (std::all_of(patch.locked.begin(), patch.locked.end(), [](bool locked) { return locked; })) {
    part.left_alone = "every vertex lies on a border, a cut or a change of material";
    return;
  }
  const UvSets uv = usedUvSets(build.scene.materials[part.material]);
  const std::vector<Corners> corners = mergeCorners(geometry, part, build.welded, uv);
  const double slack_m = 1e-9 * static_cast<double>(geometry.box.diagonal());
  constexpr int kAttempts = 4;
  const ProxyErrorMeter meter(geometry, before);
  DecimateSettings settings{
      build.options.max_error_m,
      build.options.max_normal_turn_rad,
      build.options.max_edge_share * static_cast<double>(geometry.box.diagonal()),
      &meter.original(),
      uv.first,
      uv.second};
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    part.after = decimatePatch(geometry, patch, corners, settings);
    const std::vector<Corners> faces = remaining(part.after);
    if (faces.size() == before.size()) {
      part.left_alone = "nothing can go within the bound";
      leaveAlone();
      part.error = ProxyError{};
      return;
    }
    part.error = meter.measure(faces, build.options.seed);
    const double error = std::max(part.error.to_proxy_m, part.error.to_original_m);
    if (error <= build.options.max_error_m + slack_m && areaHolds(build, part)) return;
    const double ratio = error > 0 ? build.options.max_error_m / error : 0.5;
    settings.max_error_m *= std::clamp(0.97 * ratio, 0.25, 0.97);
  }
  part.left_alone = "the error or the emitting area could not be held";
  leaveAlone();
  part.error = ProxyError{};
}

// Leaves out the vertices that no triangle uses; their order stays.
template <class T>
std::vector<T> pick(const std::vector<T>& all, const std::vector<uint32_t>& used) {
  std::vector<T> picked;
  if (all.empty()) return picked;
  for (const uint32_t i : used) picked.push_back(all[i]);
  return picked;
}

Geometry assemble(const Geometry& before, const std::vector<Part>& parts) {
  std::vector<std::optional<Corners>> after(before.triangles.size());
  for (const Part& part : parts)
    for (std::size_t i = 0; i < part.triangles.size(); ++i)
      after[part.triangles[i]] = part.after[i];
  std::vector<uint32_t> renamed(before.positions.size(), 0), used, kept_before{0};
  for (const auto& face : after) {
    kept_before.push_back(kept_before.back() + (face ? 1 : 0));
    if (face)
      for (const uint32_t v : *face) renamed[v] = 1;
  }
  Geometry result;
  for (uint32_t v = 0; v < renamed.size(); ++v) {
    if (renamed[v] == 0) continue;
    renamed[v] = static_cast<uint32_t>(used.size());
    used.push_back(v);
    result.box.extend(before.positions[v]);
  }
  for (std::size_t t = 0; t < after.size(); ++t) {
    if (!after[t]) continue;
    const Corners& f = *after[t];
    result.triangles.push_back(
        {{renamed[f[0]], renamed[f[1]], renamed[f[2]]}, before.triangles[t].material});
  }
  result.positions = pick(before.positions, used);
  result.normals = pick(before.normals, used);
  result.uv0 = pick(before.uv0, used);
  result.uv1 = pick(before.uv1, used);
  const auto keptBefore = [&](uint64_t t) {
    return kept_before[std::min<uint64_t>(t, after.size())];
  };
  for (MeshRange range : before.meshes) {
    const uint32_t first = keptBefore(range.first_triangle);
    range.triangle_count =
        keptBefore(uint64_t{range.first_triangle} + range.triangle_count) - first;
    range.first_triangle = first;
    result.meshes.push_back(range);
  }
  result.dropped_degenerate = before.dropped_degenerate;
  return result;
}

RayProxyReport makeReport(const Scene& scene, const Scene& proxy, const std::vector<Part>& parts) {
  RayProxyReport report;
  report.triangles_before = static_cast<uint32_t>(scene.geometry->triangles.size());
  report.triangles_after = static_cast<uint32_t>(proxy.geometry->triangles.size());
  for (const Part& part : parts) {
    report.original_to_proxy_m = std::max(report.original_to_proxy_m, part.error.to_proxy_m);
    report.proxy_to_original_m = std::max(report.proxy_to_original_m, part.error.to_original_m);
    if (part.left_alone)
      report.left_alone.push_back(
          {part.mesh, static_cast<uint32_t>(part.triangles.size()), part.left_alone});
  }
  const auto emitterArea = [](const Scene& s) {
    std::vector<Corners> faces;
    for (const Triangle& t : s.geometry->triangles)
      if (maxComponent(s.materials[t.material].emission) > 0)
        faces.push_back({t.vertex[0], t.vertex[1], t.vertex[2]});
    return totalArea(*s.geometry, faces);
  };
  report.emitter_area_before_m2 = emitterArea(scene);
  report.emitter_area_after_m2 = emitterArea(proxy);
  return report;
}

void checkOptions(const Scene& scene, const RayProxyOptions& options) {
  if (!(options.max_error_m >= 0) || !std::isfinite(options.max_error_m))
    throwInput("ray proxy: the error bound of {} m is not a length; give metres, 0 or more",
               options.max_error_m);
  for (const double option :
       {options.max_normal_turn_rad, options.max_edge_share, options.max_emitter_area_change})
    if (!(option >= 0)) throwInput("ray proxy: an option of {} must be 0 or more", option);
  for (const Triangle& t : scene.geometry->triangles)
    if (t.material >= scene.materials.size())
      throwInput("ray proxy: material {} of a triangle does not exist", t.material);
}

}  // namespace

RayProxy makeRayProxy(const Scene& scene, const RayProxyOptions& options) {
  const Timer timer;
  checkOptions(scene, options);
  const Geometry& geometry = *scene.geometry;
  std::vector<Part> parts = makeParts(geometry);
  const std::vector<uint32_t> welded = weldExactly(geometry.positions);
  const std::vector<bool> shared = findShared(geometry, parts, welded);
  const Build build{scene, options, welded, shared};
  parallelFor(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) decimatePart(build, parts[i]);
  });
  RayProxy result;
  result.scene = scene;
  result.scene.geometry = std::make_shared<const Geometry>(assemble(geometry, parts));
  result.report = makeReport(scene, result.scene, parts);
  result.report.max_error_m = options.max_error_m;
  result.report.build_s = timer.seconds();
  return result;
}

double proxyErrorBound(double requested_m, double thinnest_wall_m) {
  if (!(requested_m >= 0) || !std::isfinite(requested_m))
    throwInput("ray proxy: the error bound of {} m is not a length; give metres, 0 or more",
               requested_m);
  if (!(thinnest_wall_m >= 0))
    throwInput("ray proxy: a wall of {} m is not one; give metres, or infinity without walls",
               thinnest_wall_m);
  return std::min(requested_m, thinnest_wall_m / 4);
}

}  // namespace probelab
