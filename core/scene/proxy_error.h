// SPDX-License-Identifier: Apache-2.0
// How far a proxy is from what it stands for: one-sided Hausdorff distances by sampling.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proxy_patch.h"
#include "scene/scene.h"
#include "triangle_distance.h"

namespace probelab {

struct ProxyError {
  double to_proxy_m = 0;     // largest distance from a point of the original to the proxy
  double to_original_m = 0;  // and back
  double area_before_m2 = 0, area_after_m2 = 0;
};

double totalArea(const Geometry& geometry, std::span<const Corners> faces);  // square metres

class ProxyErrorMeter {
 public:
  // Both sets of faces index the same geometry, which must outlive the meter.
  ProxyErrorMeter(const Geometry& geometry, std::span<const Corners> original);
  const TriangleDistance& original() const { return to_original_; }
  // At vertices, edge midpoints and centroids, and at 2 random points by area for each triangle of
  // the original.
  ProxyError measure(std::span<const Corners> proxy, uint64_t seed) const;

 private:
  const Geometry& geometry_;
  std::vector<TrianglePoints> original_;
  TriangleDistance to_original_;
};

}  // namespace probelab
