// SPDX-License-Identifier: GPL-3.0-or-later
#include "traced_shading.h"

#include <algorithm>
#include <vector>

#include "base/interrupt.h"
#include "shared/offset.h"
#include "trace/sampling.h"
#include "tuning/exact_visibility.h"

namespace probelab {
namespace {

constexpr std::size_t kTracedAtOnce = std::size_t{1} << 16;  // between looks for an interrupt

void replacePart(std::span<const Ray> rays, std::size_t first, const FieldSnapshot& field,
                 const Params& params, const Scene& scene, const EmbreeScene& embree,
                 const MaterialTable& materials, ShadedRays& shaded) {
  std::vector<Hit> hits(rays.size());
  embree.closest(rays, hits);
  std::vector<QueryPoint> points;
  std::vector<Vec3f> albedo;
  std::vector<std::size_t> pixel;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].primitive == kNoHit || shaded.irradiance[first + i].w == 0) continue;
    const Surface s = surfaceAt(*scene.geometry, materials, hits[i], rays[i].direction);
    if (!(maxComponent(s.albedo) > 0)) continue;  // nothing is asked there
    points.push_back({offsetOrigin(s.point, s.geometric_normal, s.geometric_normal),
                      s.shading_normal, rays[i].direction});
    albedo.push_back(s.albedo);
    pixel.push_back(first + i);
  }
  const std::vector<Vec3f> traced = queryExactVisibility(field, params, points, embree);
  for (std::size_t k = 0; k < points.size(); ++k) {
    Vec4f& e = shaded.irradiance[pixel[k]];
    Vec4f& l = shaded.radiance[pixel[k]];
    const Vec3f bounce = albedo[k] * (traced[k] - Vec3f(e.x, e.y, e.z)) / kPi;
    l = Vec4f(l.x + bounce.x, l.y + bounce.y, l.z + bounce.z, l.w);
    e = Vec4f(traced[k].x, traced[k].y, traced[k].z, e.w);
  }
}

}  // namespace

void replaceVisibility(std::span<const Ray> rays, const FieldSnapshot& field, const Params& params,
                       const Scene& scene, const EmbreeScene& embree,
                       const MaterialTable& materials, ShadedRays& shaded) {
  for (std::size_t first = 0; first < rays.size(); first += kTracedAtOnce) {
    throwIfInterrupted();
    const auto part = rays.subspan(first, std::min(kTracedAtOnce, rays.size() - first));
    replacePart(part, first, field, params, scene, embree, materials, shaded);
  }
}

}  // namespace probelab
