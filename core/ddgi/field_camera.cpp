// SPDX-License-Identifier: Apache-2.0
#include "ddgi/field_camera.h"

#include <algorithm>

#include "push_constants.h"

namespace probelab {
namespace {

constexpr uint32_t kRaysAtOnce = 1u << 17;

}  // namespace

FieldCamera::FieldCamera(GpuContext& context, ProbeField& field, const Scene& scene,
                         const EmbreeScene& embree)
    : context_(context),
      field_(field),
      batch_(context, scene, embree, field.options().tracer, kRaysAtOnce),
      recorder_(context),
      hit_irradiance_(
          createBuffer(context, kRaysAtOnce * sizeof(Vec4f), MemoryUse::device, "hit irradiance")) {
  const FieldAccess access = field.access();
  resolve_ = makeStage(context, "ddgi/resolve.comp.glsl",
                       resolveDefines(field.params(), access.layout, RayUse::camera), access.inputs,
                       sizeof(ResolvePush));
}

ShadedRays FieldCamera::shade(std::span<const Ray> rays) {
  ShadedRays shaded{std::vector<Vec4f>(rays.size()), std::vector<Vec4f>(rays.size())};
  const RayBuffers& buffers = batch_.buffers();
  for (std::size_t first = 0; first < rays.size(); first += kRaysAtOnce) {
    const auto part = rays.subspan(first, std::min<std::size_t>(kRaysAtOnce, rays.size() - first));
    const auto count = static_cast<uint32_t>(part.size());
    batch_.uploadRays(part);
    batch_.trace(recorder_, count);
    recorder_.run(
        "resolve", resolve_,
        makeResolvePush(count, 0, field_.access().addresses, buffers, hit_irradiance_.address()),
        count);
    recorder_.flush();
    const auto fetch = [&](const GpuBuffer& buffer, std::vector<Vec4f>& target) {
      download(context_, buffer,
               std::as_writable_bytes(std::span<Vec4f>(target).subspan(first, part.size())));
    };
    fetch(buffers.radiance, shaded.radiance);
    fetch(hit_irradiance_, shaded.irradiance);
  }
  field_.readCounters();
  return shaded;
}

}  // namespace probelab
