// SPDX-License-Identifier: Apache-2.0
#include "ddgi/tracers.h"

#include "base/error.h"

namespace probelab {
namespace {

struct CountPush {
  uint32_t item_count;
};

template <class T>
std::span<T> mappedArray(const GpuBuffer& buffer, uint32_t count) {
  PROBELAB_CHECK(buffer.mapped() != nullptr);
  return buffer.mappedAs<T>().first(count);
}

class EmbreeTracer final : public Tracer {
 public:
  EmbreeTracer(const EmbreeScene& embree, const RayBuffers& buffers)
      : embree_(embree), buffers_(buffers) {}
  void closest(StageRecorder& recorder, uint32_t count) override {
    recorder.onHost("trace", [&] {
      embree_.closest(mappedArray<const Ray>(buffers_.rays, count),
                      mappedArray<Hit>(buffers_.hits, count));
    });
  }
  void occluded(StageRecorder& recorder, uint32_t count) override {
    recorder.onHost("occlude", [&] {
      embree_.occluded(mappedArray<const Ray>(buffers_.shadow_rays, count),
                       mappedArray<uint32_t>(buffers_.occluded, count));
    });
  }

 private:
  const EmbreeScene& embree_;
  const RayBuffers& buffers_;
};

AccelerationStructure buildFromScene(GpuContext& context, const Scene& scene) {
  const Geometry& geometry = *scene.geometry;
  std::vector<uint32_t> indices;
  std::vector<uint8_t> opaque;
  for (const Triangle& triangle : geometry.triangles) {
    indices.insert(indices.end(), triangle.vertex, triangle.vertex + 3);
    opaque.push_back(scene.materials[triangle.material].alpha_mask ? 0 : 1);
  }
  return buildAccelerationStructure(context, geometry.positions, indices, opaque);
}

class RayQueryTracer final : public Tracer {
 public:
  RayQueryTracer(GpuContext& context, const Scene& scene, const SceneBuffers& scene_buffers,
                 const RayBuffers& buffers)
      : structure_(buildFromScene(context, scene)) {
    closest_ = stage(context, scene_buffers, 0, {"RAYS", &buffers.rays}, {"HITS", &buffers.hits});
    if (buffers.shadow_rays)
      occluded_ = stage(context, scene_buffers, 1, {"RAYS", &buffers.shadow_rays},
                        {"OCCLUDED", &buffers.occluded});
  }
  void closest(StageRecorder& recorder, uint32_t count) override {
    recorder.run("trace", closest_, CountPush{count}, count);
  }
  void occluded(StageRecorder& recorder, uint32_t count) override {
    recorder.run("occlude", occluded_, CountPush{count}, count);
  }

 private:
  Stage stage(GpuContext& context, const SceneBuffers& scene_buffers, int pass, StageInput rays,
              StageInput results) {
    Defines defines = sceneDefines(scene_buffers.features);
    defines.emplace_back("PL_TRACE", std::to_string(pass));
    std::vector<StageInput> inputs = {rays, results};
    if (scene_buffers.features.alpha_mask) {
      inputs.push_back({"FIRST_TRIANGLES", &structure_.firstTriangles()});
      for (const StageInput& input : sceneInputs(scene_buffers)) inputs.push_back(input);
    }
    return makeStage(context, "ddgi/trace.comp.glsl", defines, inputs, sizeof(CountPush),
                     &structure_);
  }

  AccelerationStructure structure_;
  Stage closest_;
  Stage occluded_;
};

}  // namespace

std::unique_ptr<Tracer> makeEmbreeTracer(const EmbreeScene& embree, const RayBuffers& buffers) {
  return std::make_unique<EmbreeTracer>(embree, buffers);
}

std::unique_ptr<Tracer> makeRayQueryTracer(GpuContext& context, const Scene& scene,
                                           const SceneBuffers& scene_buffers,
                                           const RayBuffers& buffers) {
  return std::make_unique<RayQueryTracer>(context, scene, scene_buffers, buffers);
}

}  // namespace probelab
