// SPDX-License-Identifier: Apache-2.0
// A glTF or GLB file, read, checked (gltf_check.h) and parsed by tinygltf. Every index in the model
// is valid; image data are still encoded.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tinygltf.h"
#include "warnings.h"

namespace probelab {

struct GltfFile {
  std::string path;  // as asked for, for messages
  tinygltf::Model model;
  std::vector<std::string> hashes;  // of each file that was read
};

// Throws InputError naming the file and the element.
GltfFile readGltf(const std::filesystem::path& path, Warnings& warnings);

}  // namespace probelab
