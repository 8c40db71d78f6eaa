// SPDX-License-Identifier: Apache-2.0
#include "trace/area_sampler.h"

#include <algorithm>

#include "base/error.h"
#include "trace/sampling.h"
#include "trace/surface.h"

namespace probelab {

AreaSampler::AreaSampler(const Geometry& geometry) {
  double sum = 0;
  for (uint32_t i = 0; i < geometry.triangles.size(); ++i)
    cdf_.push_back(sum += static_cast<double>(faceArea(geometry, i)));
  PROBELAB_CHECK(!cdf_.empty() && sum > 0);
}

AreaSample AreaSampler::sample(Rng& rng) const {
  const auto at = std::upper_bound(cdf_.begin(), cdf_.end(), rng.nextDouble() * cdf_.back());
  const auto triangle = std::min<std::ptrdiff_t>(at - cdf_.begin(), std::ssize(cdf_) - 1);
  const float a = rng.nextFloat(), b = rng.nextFloat();
  const Vec2f uv = sampleTriangle({a, b});
  return {static_cast<uint32_t>(triangle), uv.x, uv.y};
}

}  // namespace probelab
