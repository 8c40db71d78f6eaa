// SPDX-License-Identifier: Apache-2.0
#include "trace/embree_scene.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "embree_api.h"
#include "shared/light.h"
#include "trace/surface.h"

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace probelab {
namespace {

constexpr std::size_t kRaysPerTask = 2048;

void onEmbreeError(void* user, RTCError, const char* message) {
  *static_cast<std::string*>(user) = message ? message : "unknown error";
}

// Embree asserts that coordinates and directions are below 1.8e18 in size; NaN fails too.
bool isTraceable(const Ray& r) {
  const auto ok = [](float x) { return std::abs(x) <= kFarDistance; };
  return ok(r.origin.x) && ok(r.origin.y) && ok(r.origin.z) && ok(r.direction.x) &&
         ok(r.direction.y) && ok(r.direction.z) && ok(r.t_min) && r.t_max == r.t_max;
}

void setRay(RTCRay& out, const Ray& ray) {
  out.org_x = ray.origin.x, out.org_y = ray.origin.y, out.org_z = ray.origin.z;
  out.dir_x = ray.direction.x, out.dir_y = ray.direction.y, out.dir_z = ray.direction.z;
  out.tnear = std::max(ray.t_min, 0.0f);
  out.tfar = ray.t_max;
  out.time = 0;
  out.mask = ~0u;
  out.id = 0;
  out.flags = 0;
}

[[noreturn]] void throwBadRay(std::size_t index, const Ray& r) {
  throw NumericalError(fmt::format(
      "trace: ray {} is not finite: origin ({}, {}, {}), direction ({}, {}, {}), from {} to {}",
      index, r.origin.x, r.origin.y, r.origin.z, r.direction.x, r.direction.y, r.direction.z,
      r.t_min, r.t_max));
}

}  // namespace

// Triangles of alpha-masked materials are a geometry of their own, so that only they pay for the
// filter. `original[g]` maps a geometry's primitives to the scene's triangles (empty: the same).
struct EmbreeScene::Impl {
  std::shared_ptr<const Geometry> geometry;
  MaterialTable materials;  // filled only when there are masks
  std::vector<uint32_t> original[2];
  std::string error;
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  float extent = 0;

  explicit Impl(const Scene& source);
  ~Impl() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void build();
  void addTriangles(unsigned id, bool filtered);
  uint32_t triangleOf(unsigned geometry_id, unsigned primitive) const {
    return original[geometry_id].empty() ? primitive : original[geometry_id][primitive];
  }
  static void filterMask(const RTCFilterFunctionNArguments* arguments);
  Hit trace(TraceContext& context, const Ray& ray) const;
  bool blocked(TraceContext& context, const Ray& ray) const;
  void check() const {
    if (!error.empty()) throw Error("Embree failed: " + error + "; is there enough memory?");
  }
};

// Rejects hits in the holes of a mask.
void EmbreeScene::Impl::filterMask(const RTCFilterFunctionNArguments* arguments) {
  const auto& impl = *static_cast<const Impl*>(arguments->geometryUserPtr);
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] == 0) continue;
    const uint32_t triangle = impl.triangleOf(RTCHitN_geomID(arguments->hit, arguments->N, i),
                                              RTCHitN_primID(arguments->hit, arguments->N, i));
    if (isHole(*impl.geometry, impl.materials, triangle, RTCHitN_u(arguments->hit, arguments->N, i),
               RTCHitN_v(arguments->hit, arguments->N, i)))
      arguments->valid[i] = 0;
  }
}

EmbreeScene::Impl::Impl(const Scene& source) : geometry(source.geometry) {
  PROBELAB_CHECK(geometry != nullptr);
  const auto masked = [&](const Triangle& t) { return source.materials[t.material].alpha_mask; };
  const auto& triangles = geometry->triangles;
  if (std::any_of(triangles.begin(), triangles.end(), masked)) {
    materials = makeMaterialTable(source);
    for (uint32_t i = 0; i < triangles.size(); ++i)
      original[masked(triangles[i]) ? 1 : 0].push_back(i);
  }
  if (!triangles.empty()) {
    const Vec3f low = geometry->box.min, high = geometry->box.max;
    for (int axis = 0; axis < 3; ++axis)
      extent = std::max({extent, std::abs(low[axis]), std::abs(high[axis])});
  }
  // Embree's builders split their work by the number of threads, and the tree decides which of two
  // triangles at the same distance is hit. One thread: the same tree everywhere.
  tbb::task_arena one(1);
  one.execute([&] { build(); });
  check();
}

void EmbreeScene::Impl::build() {
  device = rtcNewDevice(nullptr);
  if (!device) {
    error = "no device";
    return;
  }
  rtcSetDeviceErrorFunction(device, onEmbreeError, &error);
  scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  addTriangles(0, false);
  if (!original[1].empty()) addTriangles(1, true);
  rtcCommitScene(scene);
}

void EmbreeScene::Impl::addTriangles(unsigned id, bool filtered) {
  const auto& triangles = geometry->triangles;
  const bool all = original[0].empty() && original[1].empty();
  const std::size_t count = all ? triangles.size() : original[id].size();
  if (count == 0) return;
  RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  // Embree's own buffers: it reads 16 bytes at the last vertex, which a shared one need not have.
  auto* vertices = static_cast<Vec3f*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT3, sizeof(Vec3f),
                                                               geometry->positions.size()));
  auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(
      mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), count));
  if (vertices && indices) {
    std::copy(geometry->positions.begin(), geometry->positions.end(), vertices);
    for (std::size_t i = 0; i < count; ++i)
      std::copy_n(triangles[all ? i : original[id][i]].vertex, 3, indices + 3 * i);
    if (filtered) {
      rtcSetGeometryUserData(mesh, this);
      rtcSetGeometryIntersectFilterFunction(mesh, filterMask);
      rtcSetGeometryOccludedFilterFunction(mesh, filterMask);
    }
    rtcSetGeometryBuildQuality(mesh, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(mesh);
    rtcAttachGeometryByID(scene, mesh, id);
  }
  rtcReleaseGeometry(mesh);
}

Hit EmbreeScene::Impl::trace(TraceContext& context, const Ray& ray) const {
  RTCRayHit query;
  setRay(query.ray, ray);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.primID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  context.intersect(scene, query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {ray.t_max, kNoHit, 0, 0};
  return {query.ray.tfar, triangleOf(query.hit.geomID, query.hit.primID), query.hit.u, query.hit.v};
}

bool EmbreeScene::Impl::blocked(TraceContext& context, const Ray& ray) const {
  RTCRay query;
  setRay(query, ray);
  context.occlude(scene, query);
  return query.tfar < 0;  // Embree sets -inf
}

EmbreeScene::EmbreeScene(const Scene& scene) : impl_(std::make_unique<Impl>(scene)) {}
EmbreeScene::~EmbreeScene() = default;
EmbreeScene::EmbreeScene(EmbreeScene&&) noexcept = default;
EmbreeScene& EmbreeScene::operator=(EmbreeScene&&) noexcept = default;

void EmbreeScene::closest(std::span<const Ray> rays, std::span<Hit> hits) const {
  PROBELAB_CHECK_EQ(rays.size(), hits.size());
  parallelFor(rays.size(), kRaysPerTask, [&](std::size_t begin, std::size_t end) {
    const FlushDenormals flush;
    TraceContext context;
    for (std::size_t i = begin; i < end; ++i) {
      if (!isTraceable(rays[i])) throwBadRay(i, rays[i]);
      hits[i] = rays[i].t_max > rays[i].t_min ? impl_->trace(context, rays[i])
                                              : Hit{rays[i].t_max, kNoHit, 0, 0};
    }
  });
}

void EmbreeScene::occluded(std::span<const Ray> rays, std::span<std::uint32_t> results) const {
  PROBELAB_CHECK_EQ(rays.size(), results.size());
  parallelFor(rays.size(), kRaysPerTask, [&](std::size_t begin, std::size_t end) {
    const FlushDenormals flush;
    TraceContext context;
    for (std::size_t i = begin; i < end; ++i) {
      if (!isTraceable(rays[i])) throwBadRay(i, rays[i]);
      results[i] = rays[i].t_max > rays[i].t_min && impl_->blocked(context, rays[i]) ? 1u : 0u;
    }
  });
}

Hit EmbreeScene::closest(const Ray& ray) const {
  if (!isTraceable(ray)) throwBadRay(0, ray);
  if (!(ray.t_max > ray.t_min)) return {ray.t_max, kNoHit, 0, 0};
  TraceContext context;
  return impl_->trace(context, ray);
}

bool EmbreeScene::occluded(const Ray& ray) const {
  if (!isTraceable(ray)) throwBadRay(0, ray);
  if (!(ray.t_max > ray.t_min)) return false;
  TraceContext context;
  return impl_->blocked(context, ray);
}

float EmbreeScene::extent() const { return impl_->extent; }

#if defined(__SSE2__)
FlushDenormals::FlushDenormals() : saved_(_mm_getcsr()) {
  _mm_setcsr(saved_ | 0x8040u);  // FTZ (bit 15) and DAZ (bit 6)
}
FlushDenormals::~FlushDenormals() { _mm_setcsr(saved_); }
#else
FlushDenormals::FlushDenormals() : saved_(0) {}
FlushDenormals::~FlushDenormals() = default;
#endif

const char* embreeVersion() { return RTC_VERSION_STRING; }

}  // namespace probelab
