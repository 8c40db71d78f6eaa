// SPDX-License-Identifier: Apache-2.0
#include "trace/wall_thickness.h"

#include <algorithm>
#include <vector>

#include "base/rng.h"
#include "shared/light.h"
#include "trace/area_sampler.h"
#include "trace/sampling.h"
#include "trace/surface.h"

namespace probelab {
namespace {

// Distance to the other face of the wall behind a point of a face; negative: a single sheet.
float wallBehind(const Scene& scene, const EmbreeScene& embree, uint32_t triangle, float u, float v,
                 Vec3f& place) {
  const Geometry& geometry = *scene.geometry;
  const auto& corners = geometry.triangles[triangle].vertex;
  const BoundedPoint point =
      pointOnTriangle(geometry.positions[corners[0]], geometry.positions[corners[1]],
                      geometry.positions[corners[2]], u, v);
  const Vec3f inward = -faceNormal(geometry, triangle);
  place = point.position;
  const Hit hit = embree.closest(Ray{offsetOrigin(point, inward, inward), 0, inward, kFarDistance});
  if (hit.primitive == kNoHit) return -1;
  if (scene.materials[geometry.triangles[hit.primitive].material].double_sided) return -1;
  return dot(faceNormal(geometry, hit.primitive), inward) > 0.5f ? hit.t : -1;
}

}  // namespace

WallThickness measureWallThickness(const Scene& scene, const EmbreeScene& embree,
                                   uint32_t samples) {
  WallThickness result;
  const Geometry& geometry = *scene.geometry;
  if (geometry.triangles.empty()) return result;
  const FlushDenormals flush;
  const AreaSampler areas(geometry);
  const auto measure = [&](uint32_t triangle, float u, float v) {
    Vec3f place;
    const bool sheet = scene.materials[geometry.triangles[triangle].material].double_sided;
    const float thickness = sheet ? -1.0f : wallBehind(scene, embree, triangle, u, v, place);
    if (thickness < 0) return false;
    if (!result.has_walls || thickness < result.thinnest_m)
      result.thinnest_m = thickness, result.place = place;
    return result.has_walls = true;
  };
  uint32_t sheets = 0;
  for (uint32_t i = 0; i < samples; ++i) {
    Rng rng(0, RngStream::reachability, i);
    const AreaSample s = areas.sample(rng);
    if (!measure(s.triangle, s.u, s.v)) ++sheets;
  }
  const auto count = std::min<std::size_t>(samples, geometry.triangles.size());
  for (uint32_t i = 0; i < count; ++i) measure(i, 1.0f / 3, 1.0f / 3);
  result.sheet_share = samples > 0 ? static_cast<double>(sheets) / samples : 0;
  return result;
}

}  // namespace probelab
