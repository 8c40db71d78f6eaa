// SPDX-License-Identifier: Apache-2.0
// Points on surfaces that a point or spot light shines on, sampled from the light: the bright spots
// around a lamp, which cosine samples of a far receiver rarely hit. The path tracer connects its
// vertices to them and weights that against hitting them (bidirectional path tracing with one light
// vertex; Veach 1997, chapter 10).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "shared/light.h"
#include "trace/embree_scene.h"
#include "trace/surface.h"

namespace probelab {

struct LightVertex {
  Surface surface;
  Vec3f radiance;  // that leaves it in every direction: albedo / pi times this light's irradiance
  float pdf;       // per square metre
};

class LightVertexSampler {
 public:
  // Directional lights take no part (most of their light falls outside rooms), nor do lights within
  // 1e-3 of half the scene's longest edge of a surface, whose own fixture would end their rays.
  LightVertexSampler(std::span<const LightData> lights, const Geometry& geometry,
                     const EmbreeScene& embree);

  bool empty() const { return total_ == 0; }
  // One ray from one light. Nothing where it leaves the scene, or falls on black or a back face.
  std::optional<LightVertex> sample(const Geometry& geometry, const MaterialTable& materials,
                                    const EmbreeScene& embree, float choice, const Vec2f& u) const;
  // Density per square metre with which sample() finds the point x with unit normal n by way of
  // light i, which must see it; 0 for lights that take no part.
  float pdf(std::size_t i, const Vec3f& x, const Vec3f& n) const;

 private:
  float directionPdf(std::size_t i, const Vec3f& direction) const;

  std::span<const LightData> lights_;
  std::vector<float> share_;  // probability of each light
  float total_ = 0;
};

}  // namespace probelab
