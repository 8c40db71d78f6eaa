// SPDX-License-Identifier: Apache-2.0
// glTF/GLB and scene TOML -> Scene.
#pragma once

#include <filesystem>
#include <string>

#include "scene/scene.h"

namespace probelab {

// Loads a .gltf/.glb or a scene .toml, in its first lighting state. Throws InputError naming the
// file, the element and what to do. Oddities that do not stop it are in Scene::warnings.
//
// Only the glTF's default scene counts, and of its materials those that its triangles use. A
// TOML's cameras come before the glTF's, its lights after them. Lights and cameras of a glTF are
// called as their nodes; a name that comes again gets "#2". URIs inside a glTF cannot leave its
// folder; the paths in a TOML may.
Scene loadScene(const std::filesystem::path& path);

}  // namespace probelab
