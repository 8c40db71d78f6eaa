// SPDX-License-Identifier: Apache-2.0
// What `probelab init` writes: a commented scene TOML for a glTF file.
#pragma once

#include <filesystem>
#include <string>

#include "scene/scene.h"

namespace probelab {

// In world coordinates: the middle of the geometry's box (without triangles, of the bounds) at 0.4
// of its height, eye level in a room. It may lie inside something; only a tracer can tell.
Vec3d defaultCameraPosition(const Scene& scene);

// True without lights and emission: nothing in the glTF itself gives light.
bool isUnlit(const Scene& scene);

// The text of a scene TOML for `scene`, a glTF that was loaded directly. `gltf`: the path to write,
// relative to where the TOML will be. `camera_position` (world) is used if the glTF has no camera;
// it then looks along the box's longest horizontal axis, towards the further end. Sun and sky are
// added if the scene is unlit. Numbers are rounded so that the bounds never shrink.
std::string describeSceneToml(const Scene& scene, const std::filesystem::path& gltf,
                              const Vec3d& camera_position);

}  // namespace probelab
