// SPDX-License-Identifier: Apache-2.0
// The scene's lights as both renderers evaluate them (shared/light.h).
#pragma once

#include <vector>

#include "scene/scene.h"
#include "shared/light.h"

namespace probelab {

// Lights without intensity are left out.
std::vector<LightData> makeLightData(const Scene& scene);

}  // namespace probelab
