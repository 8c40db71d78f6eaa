// SPDX-License-Identifier: Apache-2.0
// An equirectangular EXR -> Sky::image. core/image, which knows more of EXR, is not below
// core/scene.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace probelab {

// Fills width, height and image from the file's R, G, B channels (or Y). Throws InputError naming
// the file for anything else, and for texels that are negative or not finite.
void readSkyImage(const std::filesystem::path& path, Sky& sky, std::vector<std::string>& hashes);

}  // namespace probelab
