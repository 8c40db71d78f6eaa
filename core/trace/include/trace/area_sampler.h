// SPDX-License-Identifier: Apache-2.0
// Points on a mesh, uniform by area.
#pragma once

#include <cstdint>
#include <vector>

#include "base/rng.h"
#include "scene/scene.h"

namespace probelab {

// Weights of the second and third vertex, as in Hit.
struct AreaSample {
  uint32_t triangle;
  float u, v;
};

class AreaSampler {
 public:
  // `geometry` must have triangles; it is not kept.
  explicit AreaSampler(const Geometry& geometry);
  double area() const { return cdf_.back(); }  // square metres
  AreaSample sample(Rng& rng) const;

 private:
  std::vector<double> cdf_;  // area of triangles 0 .. i
};

}  // namespace probelab
