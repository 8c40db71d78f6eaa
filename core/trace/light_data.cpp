// SPDX-License-Identifier: Apache-2.0
#include "trace/light_data.h"

#include <cmath>

namespace probelab {

std::vector<LightData> makeLightData(const Scene& scene) {
  std::vector<LightData> lights;
  for (const Light& light : scene.lights) {
    if (maxComponent(light.intensity) <= 0) continue;
    LightData data{};
    data.intensity = light.intensity;
    data.type = static_cast<uint32_t>(light.type);
    data.position = light.position;
    data.range = std::isfinite(light.range) ? light.range : 0.0f;
    data.direction = light.direction;
    data.cos_inner = light.cos_inner;
    data.cos_outer = light.cos_outer;
    lights.push_back(data);
  }
  return lights;
}

}  // namespace probelab
