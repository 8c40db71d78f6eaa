// SPDX-License-Identifier: Apache-2.0
#include "ddgi/tracers.h"

#include "base/error.h"

namespace probelab {
namespace {

struct TracePush {
  uint32_t item_count, unused;
  uint64_t rays, results, first_triangles;
  SceneAddresses scene;
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
      : structure_(buildFromScene(context, scene)), buffers_(buffers) {
    if (scene_buffers.features.alpha_mask) {
      scene_ = sceneAddresses(scene_buffers);
      first_triangles_ = structure_.firstTriangles().address();
    }
    Defines defines = sceneDefines(scene_buffers.features);
    defines.emplace_back("PL_TRACE", "0");
    const auto stage = [&] {
      return makeStage(context, "ddgi/trace.comp.glsl", defines, {}, sizeof(TracePush),
                       &structure_);
    };
    closest_ = stage();
    if (!buffers.shadow_rays) return;
    defines.back().second = "1";
    occluded_ = stage();
  }
  void closest(StageRecorder& recorder, uint32_t count) override {
    recorder.run("trace", closest_, push(count, buffers_.rays, buffers_.hits), count);
  }
  void occluded(StageRecorder& recorder, uint32_t count) override {
    recorder.run("occlude", occluded_, push(count, buffers_.shadow_rays, buffers_.occluded), count);
  }

 private:
  TracePush push(uint32_t count, const GpuBuffer& rays, const GpuBuffer& results) const {
    return {count, 0, rays.address(), results.address(), first_triangles_, scene_};
  }

  AccelerationStructure structure_;
  const RayBuffers& buffers_;
  SceneAddresses scene_{};  // with cut-out materials
  uint64_t first_triangles_ = 0;
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
