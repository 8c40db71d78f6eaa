// SPDX-License-Identifier: Apache-2.0
// The yardstick of the trace stage: nothing but rtcIntersect1 over rays that lie ready in Embree's
// own layout. Used by `probelab bench` alone.
#pragma once

#include <memory>
#include <span>

#include "scene/scene.h"
#include "shared/ray.h"

namespace probelab {

class BareLoop {
 public:
  // A robust, high-quality tree as EmbreeScene builds; alpha masks are ignored.
  explicit BareLoop(const Scene& scene);
  ~BareLoop();
  BareLoop(const BareLoop&) = delete;
  BareLoop& operator=(const BareLoop&) = delete;

  // Milliseconds for the closest hits of all rays with the threads of parallelFor; laying them out
  // does not count. Rays must be finite.
  double milliseconds(std::span<const Ray> rays) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace probelab
