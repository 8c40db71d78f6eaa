// SPDX-License-Identifier: GPL-3.0-or-later
#include "input_identity.h"

#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/files.h"
#include "base/hash.h"

namespace probelab {
namespace {

// The JSON of a glTF or of a GLB's first chunk.
std::string_view jsonPart(std::string_view bytes) {
  if (!bytes.starts_with("glTF") || bytes.size() < 20) return bytes;
  uint32_t length = 0;
  std::memcpy(&length, bytes.data() + 12, sizeof length);
  return bytes.substr(20, length);
}

}  // namespace

std::string inputIdentity(const std::filesystem::path& path) {
  const std::string bytes = readTextFile(path);
  std::string identity = contentHash(bytes);
  if (path.extension() != ".gltf" && path.extension() != ".glb") return identity;
  const nlohmann::json root = nlohmann::json::parse(jsonPart(bytes), nullptr, false);
  if (!root.is_object() || !root.contains("buffers")) return identity;
  for (const nlohmann::json& buffer : root["buffers"]) {
    const auto uri = buffer.is_object() ? buffer.find("uri") : buffer.end();
    if (uri == buffer.end() || !uri->is_string()) continue;
    const std::filesystem::path name(uri->get<std::string>());
    std::error_code ec;
    const std::filesystem::path beside = path.parent_path() / name;
    if (!name.has_parent_path() && std::filesystem::is_regular_file(beside, ec))
      identity += contentHash(readTextFile(beside));
  }
  return contentHash(identity);
}

}  // namespace probelab
