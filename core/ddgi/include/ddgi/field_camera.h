// SPDX-License-Identifier: Apache-2.0
// Camera rays lit by a field. They have a tracer and buffers of their own, so that what the camera
// sees need not be what the probes see (ray proxies, texture footprints).
#pragma once

#include <span>
#include <vector>

#include "ddgi/probe_field.h"

namespace probelab {

// [ray]: outgoing radiance (rgb) with the signed distance in w, and the field's irradiance at the
// hit with 1 in w where something reflects.
struct ShadedRays {
  std::vector<Vec4f> radiance, irradiance;
};

class FieldCamera {
 public:
  // All arguments must outlive the camera; `embree` is the scene's.
  FieldCamera(GpuContext& context, ProbeField& field, const Scene& scene,
              const EmbreeScene& embree);

  FieldCamera(const FieldCamera&) = delete;
  FieldCamera& operator=(const FieldCamera&) = delete;

  ShadedRays shade(std::span<const Ray> rays);

 private:
  GpuContext& context_;
  ProbeField& field_;
  RayBatch batch_;
  StageRecorder recorder_;
  GpuBuffer hit_irradiance_;  // [ray]
  Stage resolve_;
};

}  // namespace probelab
