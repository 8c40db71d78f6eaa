// SPDX-License-Identifier: Apache-2.0
#include "trace/bare_loop.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/timer.h"
#include "embree_api.h"
#include "trace/embree_scene.h"

namespace probelab {

struct BareLoop::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  ~Impl() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }
  void build(const Geometry& geometry);
};

void BareLoop::Impl::build(const Geometry& geometry) {
  device = rtcNewDevice(nullptr);
  if (!device) throw Error("Embree failed: no device");
  scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  if (!geometry.triangles.empty()) {
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<Vec3f*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0,
                                                                 RTC_FORMAT_FLOAT3, sizeof(Vec3f),
                                                                 geometry.positions.size()));
    auto* indices = static_cast<uint32_t*>(
        rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(uint32_t), geometry.triangles.size()));
    if (!vertices || !indices) throw Error("Embree failed: out of memory");
    std::copy(geometry.positions.begin(), geometry.positions.end(), vertices);
    for (std::size_t i = 0; i < geometry.triangles.size(); ++i)
      std::copy_n(geometry.triangles[i].vertex, 3, indices + 3 * i);
    rtcSetGeometryBuildQuality(mesh, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcReleaseGeometry(mesh);
  }
  rtcCommitScene(scene);
}

BareLoop::BareLoop(const Scene& scene) : impl_(std::make_unique<Impl>()) {
  tbb::task_arena one(1);  // the same tree as EmbreeScene's, whatever the number of threads
  one.execute([&] { impl_->build(*scene.geometry); });
}
BareLoop::~BareLoop() = default;

double BareLoop::milliseconds(std::span<const Ray> rays) const {
  std::vector<RTCRayHit> queries(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = rays[i];
    RTCRay& out = queries[i].ray;
    out.org_x = ray.origin.x, out.org_y = ray.origin.y, out.org_z = ray.origin.z;
    out.dir_x = ray.direction.x, out.dir_y = ray.direction.y, out.dir_z = ray.direction.z;
    out.tnear = ray.t_min, out.tfar = ray.t_max, out.mask = ~0u;
    queries[i].hit.geomID = RTC_INVALID_GEOMETRY_ID;
    queries[i].hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  }
  constexpr std::size_t kRaysPerTask = 2048;
  const Timer timer;
  parallelFor(queries.size(), kRaysPerTask, [&](std::size_t begin, std::size_t end) {
    const FlushDenormals flush;
    TraceContext context;
    for (std::size_t i = begin; i < end; ++i) context.intersect(impl_->scene, queries[i]);
  });
  return timer.milliseconds();
}

}  // namespace probelab
