// SPDX-License-Identifier: Apache-2.0
// glTF/GLB and scene TOML -> Scene.
#pragma once

#include <filesystem>
#include <string>

#include "scene/scene.h"

namespace probelab {

// Loads a .gltf/.glb or a scene .toml, in its first lighting state. Throws InputError naming the
// file, the element and what to do. Oddities that do not stop it are in Scene::warnings.
Scene loadScene(const std::filesystem::path& path);

}  // namespace probelab
