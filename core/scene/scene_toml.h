// SPDX-License-Identifier: Apache-2.0
// A scene TOML's contents, checked, in world coordinates. scene/load.h lists the keys.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "gltf_scene.h"
#include "scene/scene.h"

namespace probelab {

// An error that can only be seen once the glTF is loaded, at the TOML's own line.
using TomlFailure = std::function<void(const std::string& what)>;

// [[state]] as written; lights are looked up once all are known.
struct StateEntry {
  LightingState state;
  TomlFailure fail;
};

struct SceneToml {
  std::filesystem::path gltf;       // resolved; empty: none
  std::filesystem::path sky_image;  // likewise
  double time_s = 0;
  double turn_rad = 0;  // turn.h
  Sky sky;
  std::vector<PlacedLight> lights;
  std::vector<PlacedCamera> cameras;
  std::optional<Box3d> volume;
  std::vector<Vec3d> seeds;
  std::optional<FlipExposures> flip;
  std::vector<StateEntry> states;
  TomlFailure fail;            // at the file's first line
  TomlFailure fail_receivers;  // at [receivers]
};

// Throws InputError naming file, line and key.
SceneToml readSceneToml(const std::filesystem::path& path, std::vector<std::string>& hashes);

}  // namespace probelab
