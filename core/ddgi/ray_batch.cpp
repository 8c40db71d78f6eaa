// SPDX-License-Identifier: Apache-2.0
#include "ddgi/ray_batch.h"

#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/suggest.h"
#include "ddgi/constants.h"
#include "ddgi/tracers.h"

namespace probelab {
namespace {

struct ShadePush {
  uint32_t item_count;
  float cone_area;
  uint64_t rays, hits, surfaces;
  SceneAddresses scene;
  uint64_t sky_image;
};
static_assert(sizeof(ShadePush) <= 128);
struct LightPush {
  uint32_t item_count, light;
  uint64_t surfaces, shadow_rays, occluded;
};

RayBuffers makeBuffers(GpuContext& context, uint32_t capacity, bool on_host, bool has_lights) {
  const MemoryUse shared = on_host ? MemoryUse::host_visible : MemoryUse::device;
  const uint64_t n = capacity;
  RayBuffers buffers;
  buffers.capacity = capacity;
  buffers.rays = createBuffer(context, n * sizeof(Ray), shared, "rays");
  buffers.hits = createBuffer(context, n * sizeof(Hit), shared, "hits");
  buffers.surfaces = createBuffer(context, n * sizeof(RaySurface), MemoryUse::device, "surfaces");
  buffers.radiance = createBuffer(context, n * sizeof(Vec4f), MemoryUse::device, "radiance");
  buffers.distances = createBuffer(context, n * sizeof(float), MemoryUse::device, "distances");
  if (has_lights) {
    buffers.shadow_rays = createBuffer(context, n * sizeof(Ray), shared, "shadow rays");
    buffers.occluded = createBuffer(context, n * sizeof(uint32_t), shared, "occluded");
  }
  return buffers;
}

// Of the disc that a cone cuts out 1 m from its apex, square metres; beyond any scene's size from a
// half space on.
float coneArea(float half_angle_rad) {
  constexpr double kEverything = 1e12;
  const double t = std::tan(static_cast<double>(half_angle_rad));
  if (half_angle_rad >= 0.5 * std::numbers::pi) return static_cast<float>(kEverything);
  return static_cast<float>(std::min(std::numbers::pi * t * t, kEverything));
}

TextureLevels levelsFor(float footprint_rad) {
  return footprint_rad > 0 ? TextureLevels::all : TextureLevels::base;
}

}  // namespace

float raySpread(int rays) {
  PROBELAB_CHECK(rays > 0);
  return static_cast<float>(std::acos(1 - 2.0 / rays));
}

TracerKind parseTracer(const std::string& name) {
  if (name == "auto") return TracerKind::automatic;
  if (name == "rayquery") return TracerKind::rayquery;
  if (name == "embree") return TracerKind::embree;
  const std::vector<std::string> known = {"auto", "rayquery", "embree"};
  throwInput("unknown tracer '{}'{}", name, suggestion(name, known));
}

uint64_t rayBytes(bool has_lights) {
  return sizeof(Ray) + sizeof(Hit) + sizeof(RaySurface) + sizeof(Vec4f) + sizeof(float) +
         (has_lights ? sizeof(Ray) + sizeof(uint32_t) : 0);
}

RayBatch::RayBatch(GpuContext& context, const Scene& scene, const EmbreeScene& embree,
                   TracerKind tracer, uint32_t capacity, float footprint_rad)
    : context_(context), scene_(uploadScene(context, scene, levelsFor(footprint_rad))) {
  const DeviceInfo& device = context.info();
  if (tracer == TracerKind::automatic)
    tracer = device.ray_query && !device.is_cpu ? TracerKind::rayquery : TracerKind::embree;
  if (tracer == TracerKind::rayquery && !device.ray_query)
    throw DeviceError(
        fmt::format("{} has no ray query; use --tracer embree, or a newer driver", device.name));
  const bool has_lights = scene_.light_count > 0;
  buffers_ = makeBuffers(context, capacity, tracer == TracerKind::embree, has_lights);
  tracer_name_ = tracer == TracerKind::embree ? "embree" : "rayquery";
  if (scene_.features.triangles)
    tracer_ = tracer == TracerKind::embree ? makeEmbreeTracer(embree, buffers_)
                                           : makeRayQueryTracer(context, scene, scene_, buffers_);

  const Defines defines = sceneDefines(scene_.features);
  std::vector<StageInput> inputs;
  if (scene_.sky) inputs.push_back({"SKY", &scene_.sky});
  shade_ = makeStage(context, "ddgi/shade.comp.glsl", defines, inputs, sizeof(ShadePush));
  if (scene_.features.textures && footprint_rad > 0) {
    cone_area_ = coneArea(footprint_rad);
    Defines footprint_defines = defines;
    footprint_defines.emplace_back("PL_TEXTURE_LOD", "1");
    shade_footprint_ =
        makeStage(context, "ddgi/shade.comp.glsl", footprint_defines, inputs, sizeof(ShadePush));
  }
  if (!has_lights) return;
  for (const int pass : {0, 1}) {
    Defines light_defines = defines;
    light_defines.emplace_back("PL_LIGHT_PASS", std::to_string(pass));
    (pass == 0 ? shadow_rays_ : add_light_) =
        makeStage(context, "ddgi/light.comp.glsl", light_defines, {{"LIGHTS", &scene_.lights}},
                  sizeof(LightPush));
  }
}

void RayBatch::uploadRays(std::span<const Ray> rays) { uploadArray(context_, buffers_.rays, rays); }

void RayBatch::traceSurfaces(StageRecorder& recorder, uint32_t count, TextureDetail detail) {
  PROBELAB_CHECK(count <= buffers_.capacity);
  if (tracer_) tracer_->closest(recorder, count);
  const bool footprint = detail == TextureDetail::footprint && cone_area_ > 0;
  const ShadePush push{.item_count = count,
                       .cone_area = cone_area_,
                       .rays = buffers_.rays.address(),
                       .hits = buffers_.hits.address(),
                       .surfaces = buffers_.surfaces.address(),
                       .scene = sceneAddresses(scene_),
                       .sky_image = scene_.sky_image ? scene_.sky_image.address() : 0};
  recorder.run("shade", footprint ? shade_footprint_ : shade_, push, count);
}

void RayBatch::trace(StageRecorder& recorder, uint32_t count, TextureDetail detail) {
  traceSurfaces(recorder, count, detail);
  for (uint32_t light = 0; light < scene_.light_count; ++light) {
    const LightPush push{count, light, buffers_.surfaces.address(), buffers_.shadow_rays.address(),
                         buffers_.occluded.address()};
    recorder.run("shade", shadow_rays_, push, count);
    if (tracer_) tracer_->occluded(recorder, count);
    recorder.run("shade", add_light_, push, count);
  }
}

}  // namespace probelab
