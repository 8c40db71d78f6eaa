// SPDX-License-Identifier: Apache-2.0
// The scene on the device, with no more buffers than its features need, and the defines that
// specialise the stages to it.
#pragma once

#include "ddgi/constants.h"
#include "ddgi/stage.h"
#include "scene/scene.h"
#include "trace/surface.h"

namespace probelab {

struct SceneBuffers {
  SceneFeatures features;
  uint32_t light_count = 0;
  GpuBuffer triangles, positions, materials, normals, uv0, uv1, texels;
  GpuBuffer sky, sky_image, lights;
};

SceneBuffers uploadScene(GpuContext& context, const Scene& scene,
                         TextureLevels levels = TextureLevels::base);

// PL_TRIANGLES, PL_TEXTURES, ... as 0 or 1.
Defines sceneDefines(const SceneFeatures& features);
SceneAddresses sceneAddresses(const SceneBuffers& buffers);

}  // namespace probelab
