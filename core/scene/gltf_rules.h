// SPDX-License-Identifier: Apache-2.0
// The glTF 2.0 schema as far as the loader reads it, as a table. Called by gltf_check.cpp.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

namespace probelab {

enum class GltfKind { number, numbers, size, index, text, boolean, array, object };

struct GltfRule {
  // Keys joined by '/'; "[]" stands for each element of an array, "*" for each value of an object.
  const char* path;
  GltfKind kind;
  bool required = false;    // by the object that it belongs to, where that exists
  int length = 0;           // numbers: how many
  const char* target = "";  // index: path of the array that it points into
};

std::span<const GltfRule> gltfRules();

// Throws InputError naming `file` and the offending path, as in "meshes[2].primitives[0].indices".
void checkGltfRule(const std::string& file, const nlohmann::json& root, const GltfRule& rule);

}  // namespace probelab
