// SPDX-License-Identifier: Apache-2.0
#include "trace/path_tracer.h"

#include <algorithm>
#include <cmath>

#include "trace/light_data.h"
#include "trace/light_sampling.h"
#include "trace/light_vertices.h"
#include "trace/sampler.h"
#include "trace/sampling.h"

namespace probelab {
namespace {

// Pairs of dimensions: 0 is the camera's, then these at each vertex of the path.
enum : uint32_t {
  kDirectionPair = 1,
  kEmitterPair = 2,
  kChoicePair = 3,  // emitter, roulette
  kLampPair = 4,
  kLampChoicePair = 5,
  kPairsPerVertex = 5
};

// Roulette starts at this vertex, and its survival stays below this bound, so that paths end where
// the albedo is 1.
constexpr uint32_t kRouletteVertex = 3;
constexpr float kMaxSurvival = 0.9995f;

bool isZero(const Vec3f& v) { return v.x == 0 && v.y == 0 && v.z == 0; }

}  // namespace

struct PathTracer::Vertex {
  Vec3f origin;  // offset to the front side
  Vec3f geometric_normal, shading_normal;
  float max_albedo = 1;
};

// How the path came to a surface, where it could also have been connected to.
struct PathTracer::Arrival {
  float pdf;  // per steradian
  float distance_m;
  float cosine;  // with the geometric normal, positive
};

PathTracer::PathTracer(const Scene& scene, const EmbreeScene& embree)
    : scene_(scene),
      embree_(embree),
      materials_(makeMaterialTable(scene)),
      lights_(makeLightData(scene)) {
  emitters_ = std::make_unique<LightSampler>(*scene.geometry, materials_, scene.sky);
  light_vertices_ = std::make_unique<LightVertexSampler>(lights_, *scene.geometry, embree);
  setConnections(true);
}
PathTracer::~PathTracer() = default;

void PathTracer::setConnections(bool on) { connect_ = on && !light_vertices_->empty(); }

Vec3f PathTracer::skyRadiance(const Vec3f& direction) const {
  return emitters_->sky().radiance(direction);
}

Vec3f PathTracer::deltaIrradiance(const BoundedPoint& point, const Vec3f& geometric_normal,
                                  const Vec3f& shading_normal, RayCount& rays) const {
  Surface surface;
  surface.point = point;
  surface.geometric_normal = geometric_normal;
  surface.shading_normal = shading_normal;
  return lightsAt(surface, nullptr, rays);
}

// E_delta; with an arrival each light is weighted against the connection to its light vertices.
Vec3f PathTracer::lightsAt(const Surface& surface, const Arrival* arrival, RayCount& rays) const {
  Vec3f sum;
  if (lights_.empty()) return sum;
  const Vec3f normal = surface.geometric_normal;
  const Vec3f origin = offsetOrigin(surface.point, normal, normal);
  for (std::size_t i = 0; i < lights_.size(); ++i) {
    const LightSample sample = sampleLight(lights_[i], origin);
    const float cosine = dot(surface.shading_normal, sample.direction);
    if (!(cosine > 0) || !(dot(normal, sample.direction) > 0) || isZero(sample.irradiance))
      continue;
    ++rays.shadow;
    if (embree_.occluded(Ray{origin, 0, sample.direction, sample.t_max})) continue;
    float weight = 1;
    if (arrival) {
      const float area_pdf = light_vertices_->pdf(i, surface.point.position, normal);
      weight = powerHeuristic(
          arrival->pdf, area_pdf * arrival->distance_m * arrival->distance_m / arrival->cosine);
    }
    sum += sample.irradiance * (cosine * weight);
  }
  return sum;
}

// One connection to a surface that a lamp shines on, weighted against hitting it.
Vec3f PathTracer::connectedIrradiance(const Vertex& vertex, const PathSampler& sampler,
                                      uint32_t dimension, RayCount& rays) const {
  ++rays.closest;
  const auto light = light_vertices_->sample(geometry(), materials_, embree_,
                                             sampler.pair(dimension + kLampChoicePair).x,
                                             sampler.pair(dimension + kLampPair));
  if (!light) return Vec3f();
  const Surface& surface = light->surface;
  const Vec3f target =
      offsetOrigin(surface.point, surface.geometric_normal, surface.geometric_normal);
  const Vec3f to_target = target - vertex.origin;
  const float distance_m = length(to_target);
  if (!(distance_m > 1e-15f)) return Vec3f();
  const Vec3f direction = to_target * (1.0f / distance_m);
  const float cosine = dot(vertex.shading_normal, direction);
  const float cosine_there = -dot(surface.geometric_normal, direction);
  if (!(cosine > 0) || !(dot(vertex.geometric_normal, direction) > 0) || !(cosine_there > 0))
    return Vec3f();
  ++rays.shadow;
  if (embree_.occluded(Ray{vertex.origin, 0, direction, distance_m * (1.0f - kLightGap)}))
    return Vec3f();
  const float pdf = light->pdf * distance_m * distance_m / cosine_there;
  return light->radiance * (powerHeuristic(pdf, cosine / kPi) * cosine / pdf);
}

// One light sample of emissive triangles and the sky, weighted against the cosine sample.
Vec3f PathTracer::emitterIrradiance(const Vertex& vertex, const PathSampler& sampler,
                                    uint32_t dimension, RayCount& rays) const {
  const EmitterSample light =
      emitters_->sample(vertex.origin, sampler.pair(dimension + kChoicePair).x,
                        sampler.pair(dimension + kEmitterPair));
  if (!(light.pdf > 0) || isZero(light.radiance)) return Vec3f();
  const float cosine = dot(vertex.shading_normal, light.direction);
  if (!(cosine > 0) || !(dot(vertex.geometric_normal, light.direction) > 0)) return Vec3f();
  ++rays.shadow;
  if (embree_.occluded(Ray{vertex.origin, 0, light.direction, light.t_max})) return Vec3f();
  const float weight = powerHeuristic(light.pdf, cosine / kPi);
  return light.radiance * (weight * cosine / light.pdf);
}

// E = sum over the path's vertices of (product of albedos so far) times what arrives there from
// emitters and from surfaces under point, spot and directional lights. A cosine sample of radiance
// L has the value pi L.
Vec3f PathTracer::fieldIrradiance(const BoundedPoint& point, const Vec3f& geometric_normal,
                                  const Vec3f& shading_normal, const PathSampler& sampler,
                                  RayCount& rays) const {
  Vertex vertex{offsetOrigin(point, geometric_normal, geometric_normal), geometric_normal,
                shading_normal};
  Vec3f result, throughput(1.0f);
  const bool use_emitters = !emitters_->empty();
  for (uint32_t depth = 0;; ++depth) {
    const uint32_t dimension = depth * kPairsPerVertex;
    if (use_emitters) result += throughput * emitterIrradiance(vertex, sampler, dimension, rays);
    if (connect_) result += throughput * connectedIrradiance(vertex, sampler, dimension, rays);
    if (depth >= kRouletteVertex) {
      // The product of albedos over survivals stays where it was: the largest albedo decides.
      const float survival = std::min(vertex.max_albedo, kMaxSurvival);
      if (sampler.pair(dimension + kChoicePair).y >= survival) break;
      throughput /= survival;
    }
    const Vec3f direction =
        sampleCosine(vertex.shading_normal, sampler.pair(dimension + kDirectionPair));
    const float cosine = dot(vertex.shading_normal, direction);
    if (!(cosine > 0) || !(dot(vertex.geometric_normal, direction) > 0)) break;
    ++rays.closest;
    const Hit hit = embree_.closest(Ray{vertex.origin, 0, direction, kFarDistance});
    if (hit.primitive == kNoHit) {
      const float weight = powerHeuristic(cosine / kPi, emitters_->skyPdf(direction));
      result += throughput * skyRadiance(direction) * (kPi * weight);
      break;
    }
    const Surface surface = surfaceAt(geometry(), materials_, hit, direction);
    if (surface.is_black_backface) break;
    if (!isZero(surface.emission)) {
      const float light_pdf =
          emitters_->trianglePdf(hit.primitive, hit.t, dot(surface.geometric_normal, direction));
      result += throughput * surface.emission * (kPi * powerHeuristic(cosine / kPi, light_pdf));
    }
    throughput *= surface.albedo;
    if (isZero(throughput)) break;
    const Arrival arrival{cosine / kPi, hit.t, -dot(surface.geometric_normal, direction)};
    result += throughput * lightsAt(surface, connect_ ? &arrival : nullptr, rays);
    vertex = {offsetOrigin(surface.point, surface.geometric_normal, surface.geometric_normal),
              surface.geometric_normal, surface.shading_normal, maxComponent(surface.albedo)};
  }
  return result;
}

}  // namespace probelab
