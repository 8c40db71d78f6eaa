// SPDX-License-Identifier: Apache-2.0
// Next-event estimation of what is not a delta light: emissive triangles by power, and the sky.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "scene/scene.h"
#include "shared/sky.h"
#include "trace/surface.h"

namespace probelab {

// The sky of a scene, scale multiplied in, with an exact sampling density for each kind: uniform,
// linear (1 + linear . d), and images by radiance times the texel's solid angle.
class SkySampler {
 public:
  explicit SkySampler(const Sky& sky);
  bool black() const { return black_; }
  // Whether a light sample can beat a cosine sample: for an image. A uniform or linear sky is
  // within a factor 2 of constant, which the cosine sample follows.
  bool worthSampling() const { return !black_ && data_.width > 0; }

  Vec3f radiance(const Vec3f& direction) const;
  // Unit direction; u uniform in [0, 1)^2.
  Vec3f sample(const Vec2f& u) const;
  float pdf(const Vec3f& direction) const;  // per steradian

 private:
  Vec3f sampleLinear(const Vec2f& u) const;
  Vec3f sampleImage(const Vec2f& u) const;

  SkyData data_{};
  bool black_ = true;
  std::vector<Vec3f> image_;        // [y][x], scaled
  std::vector<double> row_cdf_;     // [y + 1]
  std::vector<double> column_cdf_;  // [y][x + 1]
  std::vector<float> density_;      // per steradian, [y][x]
};

// A direction towards an emitter.
struct EmitterSample {
  Vec3f direction;  // unit
  float t_max = 0;  // end of the shadow ray
  Vec3f radiance;   // without occlusion
  float pdf = 0;    // per steradian; 0: nothing was sampled
};

class LightSampler {
 public:
  // References are kept.
  LightSampler(const Geometry& geometry, const MaterialTable& materials, const Sky& sky);

  bool empty() const { return triangles_.empty() && !sky_.worthSampling(); }
  const SkySampler& sky() const { return sky_; }

  // From `x` (the offset origin). `choice` picks the emitter, `u` the point on it.
  EmitterSample sample(const Vec3f& x, float choice, const Vec2f& u) const;
  // Density with which sample() finds the direction that hit a triangle at `distance_m`, whose
  // geometric normal has the cosine `cosine` with the ray.
  float trianglePdf(uint32_t triangle, float distance_m, float cosine) const {
    if (area_pdf_.empty()) return 0;
    return area_pdf_[triangle] * distance_m * distance_m / std::abs(cosine);
  }
  float skyPdf(const Vec3f& direction) const {
    return sky_.worthSampling() ? sky_share_ * sky_.pdf(direction) : 0;
  }

 private:
  EmitterSample sampleTriangleAt(const Vec3f& x, double choice, const Vec2f& u) const;

  const Geometry& geometry_;
  const MaterialTable& materials_;
  SkySampler sky_;
  float sky_share_ = 0;              // probability of choosing the sky
  std::vector<uint32_t> triangles_;  // those that emit
  std::vector<double> cdf_;          // of their power, as long as triangles_
  std::vector<float> area_pdf_;      // per square metre, for every triangle; empty: none emits
};

}  // namespace probelab
