// SPDX-License-Identifier: GPL-3.0-or-later
// Tiny files, and the damage done to them.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "workbench.h"

namespace probelab {

// A GLB of one node "chair" with a mesh "seat" of indexed triangles.
struct TinyGltf {
  explicit TinyGltf(const std::vector<float>& positions = {0, 0, 0, 1, 0, 0, 0, 1, 0},
                    const std::vector<uint16_t>& indices = {0, 1, 2});
  nlohmann::json root;
  std::string bin;
  std::string glb() const;
};

void writeBytes(const std::filesystem::path& path, const std::string& bytes);

// Loads the glTF from a file of its own in the folder.
Scene loadTiny(Workbench& bench, const TinyGltf& gltf);
// refused() of loading it after `damage`.
Measurement refusedGltf(Workbench& bench, const std::function<void(TinyGltf&)>& damage,
                        const std::vector<std::string>& parts);

}  // namespace probelab
