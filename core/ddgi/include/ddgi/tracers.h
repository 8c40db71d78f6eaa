// SPDX-License-Identifier: Apache-2.0
// The two tracers of ddgi/ray_batch.h.
#pragma once

#include <memory>

#include "ddgi/ray_batch.h"

namespace probelab {

// On the host, through the mapped buffers. Both arguments must outlive the tracer.
std::unique_ptr<Tracer> makeEmbreeTracer(const EmbreeScene& embree, const RayBuffers& buffers);

// VK_KHR_ray_query on an acceleration structure of its own. `scene_buffers` and `buffers` must
// outlive the tracer.
std::unique_ptr<Tracer> makeRayQueryTracer(GpuContext& context, const Scene& scene,
                                           const SceneBuffers& scene_buffers,
                                           const RayBuffers& buffers);

}  // namespace probelab
