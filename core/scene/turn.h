// SPDX-License-Identifier: Apache-2.0
// turn_deg of a scene TOML: the whole scene turned about the vertical axis.
#pragma once

#include "gltf_scene.h"
#include "scene_toml.h"

namespace probelab {

// Turns geometry, lights, cameras, seeds, states and the sky's gradient by toml.turn_rad about the
// world's +Y axis, counter-clockwise seen from above. The TOML has neither a volume nor a sky
// image.
void turnScene(SceneToml& toml, GltfScene& gltf);

}  // namespace probelab
