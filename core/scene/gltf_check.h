// SPDX-License-Identifier: Apache-2.0
// What must hold of a glTF's JSON before tinygltf sees it. tinygltf skips values of a wrong type,
// truncates integers and follows references unchecked; after this check, it cannot go wrong so.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "file_guard.h"
#include "warnings.h"

namespace probelab {

// Parses with a limit on nesting. Throws InputError naming `file` and the place.
nlohmann::json parseGltfJson(const std::string& file, std::string_view text);

// Types, array lengths and ranges of every property that the loader reads, and that every index
// names something that exists. Throws InputError naming file and element.
void checkGltfStructure(const std::string& file, const nlohmann::json& root);

// Version and extensions: an unknown required one, or compressed geometry, is an error; what is
// only used and ignored gets a warning.
void checkGltfExtensions(const std::string& file, const nlohmann::json& root, Warnings& warnings);

// Buffers, views and URIs: every URI stays in the folder, every buffer is as long as it says, every
// view lies inside its buffer. `bin_bytes`: length of a GLB's binary chunk. Reads no file's
// content.
void checkGltfBuffers(const std::string& file, const nlohmann::json& root, bool glb,
                      std::size_t bin_bytes, FileGuard& guard);

}  // namespace probelab
