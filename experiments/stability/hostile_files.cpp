// SPDX-License-Identifier: GPL-3.0-or-later
#include "hostile_files.h"

#include <fmt/format.h>

#include <bit>
#include <fstream>

#include "base/error.h"
#include "scene/load.h"

namespace probelab {
namespace {

using nlohmann::json;

void append(std::string& bytes, uint32_t value, int count) {
  for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> 8 * i);
}

std::string chunk(uint32_t type, std::string data, char padding) {
  while (data.size() % 4 != 0) data += padding;
  std::string bytes;
  append(bytes, static_cast<uint32_t>(data.size()), 4);
  append(bytes, type, 4);
  return bytes + data;
}

}  // namespace

TinyGltf::TinyGltf(const std::vector<float>& positions, const std::vector<uint16_t>& indices) {
  for (const float p : positions) append(bin, std::bit_cast<uint32_t>(p), 4);
  const std::size_t split = bin.size();
  for (const uint16_t i : indices) append(bin, i, 2);
  root = {{"asset", {{"version", "2.0"}}},
          {"scene", 0},
          {"scenes", json::array({{{"nodes", json::array({0})}}})},
          {"nodes", json::array({{{"name", "chair"}, {"mesh", 0}}})},
          {"materials", json::array({{{"name", "paint"}}})},
          {"buffers", json::array({{{"byteLength", bin.size()}}})}};
  root["bufferViews"] =
      json::array({{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", split}},
                   {{"buffer", 0}, {"byteOffset", split}, {"byteLength", bin.size() - split}}});
  root["accessors"] = json::array({{{"bufferView", 0},
                                    {"componentType", 5126},
                                    {"type", "VEC3"},
                                    {"count", positions.size() / 3}},
                                   {{"bufferView", 1},
                                    {"componentType", 5123},
                                    {"type", "SCALAR"},
                                    {"count", indices.size()}}});
  const json primitive = {{"attributes", {{"POSITION", 0}}}, {"indices", 1}, {"material", 0}};
  root["meshes"] = json::array({{{"name", "seat"}, {"primitives", json::array({primitive})}}});
}

std::string TinyGltf::glb() const {
  const std::string chunks = chunk(0x4e4f534au, root.dump(), ' ') + chunk(0x004e4942u, bin, '\0');
  std::string bytes = "glTF";
  append(bytes, 2, 4);
  append(bytes, static_cast<uint32_t>(12 + chunks.size()), 4);
  return bytes + chunks;
}

void writeBytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file << bytes;
  file.close();
  if (!file) throw Error(fmt::format("{}: cannot be written; set TMPDIR", path.string()));
}

Scene loadTiny(Workbench& bench, const TinyGltf& gltf) {
  writeBytes(bench.folder() / "tiny.glb", gltf.glb());
  return loadScene(bench.folder() / "tiny.glb");
}

Measurement refusedGltf(Workbench& bench, const std::function<void(TinyGltf&)>& damage,
                        const std::vector<std::string>& parts) {
  TinyGltf gltf;
  damage(gltf);
  return refused([&] { loadTiny(bench, gltf); }, parts);
}

}  // namespace probelab
