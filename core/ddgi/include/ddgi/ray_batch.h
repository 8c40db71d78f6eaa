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

// Half the angle at the apex of a probe ray's cone, radians. R rays share the sphere: a cone has
// the solid angle 4 pi / R = 2 pi (1 - cos spread). One ray: pi, the whole sphere.
float raySpread(int rays);

// What a ray sees of a texture: single texels, or the mean over its cone's footprint.
enum class TextureDetail { base, footprint };

// Buffers of one batch, [ray].
struct RayBuffers {
  uint32_t capacity = 0;
  GpuBuffer rays, hits, surfaces, shadow_rays, occluded, radiance, distances;
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
  // asked for and missing. `footprint_rad`: what raySpread() returns, for TextureDetail::footprint;
  // from pi / 2 on a hit shows its textures' means, with 0 there are neither coarser levels on the
  // device nor code for them.
  RayBatch(GpuContext& context, const Scene& scene, const EmbreeScene& embree, TracerKind tracer,
           uint32_t capacity, float footprint_rad = 0);

  RayBatch(const RayBatch&) = delete;
  RayBatch& operator=(const RayBatch&) = delete;

  void uploadRays(std::span<const Ray> rays);
  // Traces and lights the first `count` of buffers().rays; stages trace, shade, occlude. Camera
  // rays see the base level, as in the reference. Without a footprint both details are the base
  // level.
  void trace(StageRecorder& recorder, uint32_t count, TextureDetail detail = TextureDetail::base);
  // The same without direct light.
  void traceSurfaces(StageRecorder& recorder, uint32_t count,
                     TextureDetail detail = TextureDetail::base);

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
  float cone_area_ = 0;  // of a ray, 1 m from its origin; 0: shade_footprint_ is not there
  Stage shade_footprint_;
  Stage shadow_rays_, add_light_;
};

}  // namespace probelab
