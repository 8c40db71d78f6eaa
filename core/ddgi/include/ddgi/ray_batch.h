// SPDX-License-Identifier: Apache-2.0
// A batch of rays on its way through the wavefront: closest hit, shading, direct light. What comes
// out, a RaySurface a ray, goes to `resolve` (ddgi/probe_field.h). Probe rays and camera rays
// alike.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "ddgi/scene_buffers.h"
#include "trace/embree_scene.h"

namespace probelab {

enum class TracerKind { automatic, rayquery, embree };
TracerKind parseTracer(const std::string& name);  // throws InputError

// Buffers of one batch, [ray].
struct RayBuffers {
  uint32_t capacity = 0;
  GpuBuffer rays, hits, surfaces, shadow_rays, occluded, radiance, distances, hit_irradiance;
};

// Bytes a ray of the buffers above.
uint64_t rayBytes(bool has_lights);

// Finds hits for RayBuffers::rays and occlusion for RayBuffers::shadow_rays.
class Tracer {
 public:
  virtual ~Tracer() = default;
  virtual void closest(StageRecorder& recorder, uint32_t count) = 0;
  virtual void occluded(StageRecorder& recorder, uint32_t count) = 0;
};

// The wavefront's first half for one scene. `embree` must outlive it.
class RayBatch {
 public:
  // automatic: rayquery on a GPU that has it, otherwise embree. Throws DeviceError when rayquery is
  // asked for and missing.
  RayBatch(GpuContext& context, const Scene& scene, const EmbreeScene& embree, TracerKind tracer,
           uint32_t capacity);

  RayBatch(const RayBatch&) = delete;
  RayBatch& operator=(const RayBatch&) = delete;

  void uploadRays(std::span<const Ray> rays);
  // Traces and lights the first `count` of buffers().rays; stages trace, shade, occlude.
  void trace(StageRecorder& recorder, uint32_t count);

  const RayBuffers& buffers() const { return buffers_; }
  const SceneBuffers& scene() const { return scene_; }
  const std::string& tracerName() const { return tracer_name_; }

 private:
  GpuContext& context_;
  SceneBuffers scene_;
  RayBuffers buffers_;
  std::string tracer_name_;
  std::unique_ptr<Tracer> tracer_;  // null without triangles: everything misses, nothing occludes
  Stage shade_;
  Stage shadow_rays_, add_light_;
};

}  // namespace probelab
