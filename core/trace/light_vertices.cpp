// SPDX-License-Identifier: Apache-2.0
#include "trace/light_vertices.h"

#include <algorithm>
#include <cmath>

#include "trace/sampling.h"

namespace probelab {
namespace {

// Whether nothing is closer to the light than 1e-3 of half the scene's longest edge, by rays.
bool standsFree(const LightData& light, float half_edge, const EmbreeScene& embree) {
  constexpr int kRays = 256;
  const float near = 1e-3f * half_edge;
  for (int i = 0; i < kRays; ++i) {
    const float turn = 0.61803398875f * static_cast<float>(i);
    const Vec3f direction =
        sampleSphere({(static_cast<float>(i) + 0.5f) / kRays, turn - std::floor(turn)});
    if (embree.occluded(Ray{light.position, 0, direction, near})) return false;
  }
  return true;
}

// Cosine of the cone that a light shines into; -1: everywhere.
float coneCosine(const LightData& light) {
  return light.type == kLightSpot ? std::max(-1.0f, light.cos_outer) : -1.0f;
}

}  // namespace

LightVertexSampler::LightVertexSampler(std::span<const LightData> lights, const Geometry& geometry,
                                       const EmbreeScene& embree)
    : lights_(lights), share_(lights.size(), 0.0f) {
  // Of the box, which may lie anywhere: its largest coordinate would rule lights out far away.
  const Box3f& box = geometry.box;
  const float half_edge = box.empty() ? 0 : maxComponent(box.extent()) / 2;
  for (std::size_t i = 0; i < lights.size(); ++i) {
    if (lights[i].type == kLightDirectional || !standsFree(lights[i], half_edge, embree)) continue;
    share_[i] = maxComponent(lights[i].intensity) * (1 - coneCosine(lights[i]));
    total_ += share_[i];
  }
  for (float& share : share_) share = total_ > 0 ? share / total_ : 0;
}

float LightVertexSampler::directionPdf(std::size_t i, const Vec3f& direction) const {
  const float cone = coneCosine(lights_[i]);
  if (dot(direction, lights_[i].direction) < cone && cone > -1) return 0;
  return 1.0f / (2 * kPi * (1 - cone));
}

float LightVertexSampler::pdf(std::size_t i, const Vec3f& x, const Vec3f& n) const {
  if (!(share_[i] > 0)) return 0;
  const Vec3f to_light = lights_[i].position - x;
  const float squared = dot(to_light, to_light);
  if (!(squared > 0)) return 0;
  const Vec3f direction = to_light / std::sqrt(squared);
  return share_[i] * directionPdf(i, -direction) * std::max(0.0f, dot(direction, n)) / squared;
}

std::optional<LightVertex> LightVertexSampler::sample(const Geometry& geometry,
                                                      const MaterialTable& materials,
                                                      const EmbreeScene& embree, float choice,
                                                      const Vec2f& u) const {
  std::size_t i = 0, last = 0;
  for (; i < share_.size(); ++i) {
    if (!(share_[i] > 0)) continue;
    last = i;
    if (choice < share_[i]) break;
    choice -= share_[i];
  }
  if (i == share_.size()) i = last;  // rounding of the shares' sum
  const float cone = coneCosine(lights_[i]);
  const float c = 1 - u.x * (1 - cone), r = std::sqrt(std::max(0.0f, 1 - c * c));
  const Frame frame =
      frameAround(lights_[i].type == kLightSpot ? lights_[i].direction : Vec3f(0, 0, 1));
  const float phi = 2 * kPi * u.y;
  const Vec3f direction =
      frame.x * (r * std::cos(phi)) + frame.y * (r * std::sin(phi)) + frame.z * c;
  const Hit hit = embree.closest(Ray{lights_[i].position, 0, direction, kFarDistance});
  if (hit.primitive == kNoHit) return std::nullopt;
  LightVertex vertex;
  vertex.surface = surfaceAt(geometry, materials, hit, direction);
  if (vertex.surface.is_black_backface) return std::nullopt;
  const LightSample light = sampleLight(lights_[i], vertex.surface.point.position);
  const float cosine = std::max(0.0f, dot(vertex.surface.shading_normal, light.direction));
  vertex.radiance = vertex.surface.albedo * light.irradiance * (cosine / kPi);
  vertex.pdf = pdf(i, vertex.surface.point.position, vertex.surface.geometric_normal);
  if (!(vertex.pdf > 0) || !(maxComponent(vertex.radiance) > 0)) return std::nullopt;
  return vertex;
}

}  // namespace probelab
