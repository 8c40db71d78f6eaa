// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene_files.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>

#include "base/error.h"
#include "scene/load.h"

namespace probelab::test {
namespace fs = std::filesystem;
using nlohmann::json;
namespace {

std::string bigEndian(uint32_t value) {
  return {static_cast<char>(value >> 24), static_cast<char>(value >> 16),
          static_cast<char>(value >> 8), static_cast<char>(value)};
}

std::string littleEndian(uint32_t value) {
  std::string text = bigEndian(value);
  std::reverse(text.begin(), text.end());
  return text;
}

uint32_t crc32(const std::string& bytes) {
  uint32_t crc = 0xffffffffu;
  for (const unsigned char byte : bytes) {
    crc ^= byte;
    for (int i = 0; i < 8; ++i) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
  }
  return ~crc;
}

uint32_t adler32(const std::string& bytes) {
  uint32_t a = 1, b = 0;
  for (const unsigned char byte : bytes) a = (a + byte) % 65521, b = (b + a) % 65521;
  return b << 16 | a;
}

std::string chunk(const std::string& type, const std::string& data) {
  return bigEndian(static_cast<uint32_t>(data.size())) + type + data +
         bigEndian(crc32(type + data));
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
  std::string pattern = (fs::temp_directory_path() / "probelab_scene_XXXXXX").string();
  path_ = mkdtemp(pattern.data());
}
TemporaryFolder::~TemporaryFolder() {
  std::error_code ec;
  fs::remove_all(path_, ec);
}

void writeBytes(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

std::string base64(const std::string& bytes) {
  static const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string result;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    const std::size_t n = std::min<std::size_t>(3, bytes.size() - i);
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8 | (k < n ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) result += k <= n ? digits[group >> (18 - 6 * k) & 63] : '=';
  }
  return result;
}

// One stored (uncompressed) deflate block.
std::string pngFile(int width, int height, const std::vector<uint8_t>& rgba) {
  std::string rows;
  for (int y = 0; y < height; ++y) {
    rows += '\0';
    rows.append(reinterpret_cast<const char*>(&rgba[std::size_t{4} * y * width]),
                std::size_t{4} * width);
  }
  const auto size = static_cast<uint16_t>(rows.size());
  std::string stream = "\x78\x01\x01";
  for (const uint16_t value : {size, static_cast<uint16_t>(~size)})
    stream += {static_cast<char>(value), static_cast<char>(value >> 8)};
  stream += rows + bigEndian(adler32(rows));
  const std::string header =
      bigEndian(width) + bigEndian(height) + std::string("\x08\x06\0\0\0", 5);
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + chunk("IDAT", stream) + chunk("IEND", "");
}

GltfBuilder::GltfBuilder() {
  root = {{"asset", {{"version", "2.0"}}},
          {"scene", 0},
          {"scenes", json::array({{{"nodes", json::array()}}})}};
}

int GltfBuilder::view(const std::string& bytes, int stride) {
  while (bin.size() % 4 != 0) bin += '\0';
  json view = {{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", bytes.size()}};
  if (stride > 0) view["byteStride"] = stride;
  bin += bytes;
  root["bufferViews"].push_back(view);
  return static_cast<int>(root["bufferViews"].size()) - 1;
}

int GltfBuilder::accessor(const std::string& bytes, int component_type, const char* type,
                          std::size_t count, bool normalized) {
  json accessor = {{"bufferView", view(bytes)},
                   {"componentType", component_type},
                   {"type", type},
                   {"count", count}};
  if (normalized) accessor["normalized"] = true;
  root["accessors"].push_back(accessor);
  return static_cast<int>(root["accessors"].size()) - 1;
}

int GltfBuilder::floats(const char* type, const std::vector<float>& values) {
  const std::string name = type;
  const std::size_t n = name == "SCALAR" ? 1 : name == "VEC2" ? 2 : name == "VEC3" ? 3 : 4;
  return accessor(bytesOf(values), 5126, type, values.size() / n);
}

int GltfBuilder::indices(const std::vector<uint32_t>& values, int component_type) {
  std::string bytes;
  const int size = component_type == 5121 ? 1 : component_type == 5123 ? 2 : 4;
  for (const uint32_t value : values) bytes += littleEndian(value).substr(0, size);
  return accessor(bytes, component_type, "SCALAR", values.size());
}

int GltfBuilder::mesh(const json& primitive, const std::string& name) {
  root["meshes"].push_back({{"name", name}, {"primitives", json::array({primitive})}});
  return static_cast<int>(root["meshes"].size()) - 1;
}

int GltfBuilder::child(const json& node) {
  root["nodes"].push_back(node);
  return static_cast<int>(root["nodes"].size()) - 1;
}

int GltfBuilder::node(const json& node) {
  const int index = child(node);
  root["scenes"][0]["nodes"].push_back(index);
  return index;
}

int GltfBuilder::material(const json& material) {
  root["materials"].push_back(material);
  return static_cast<int>(root["materials"].size()) - 1;
}

int GltfBuilder::texture(const std::string& png, const json& sampler) {
  root["images"].push_back({{"bufferView", view(png)}, {"mimeType", "image/png"}});
  json texture = {{"source", root["images"].size() - 1}};
  if (!sampler.is_null()) {
    root["samplers"].push_back(sampler);
    texture["sampler"] = root["samplers"].size() - 1;
  }
  root["textures"].push_back(texture);
  return static_cast<int>(root["textures"].size()) - 1;
}

int GltfBuilder::light(const json& light) {
  json& lights = root["extensions"]["KHR_lights_punctual"]["lights"];
  lights.push_back(light);
  return static_cast<int>(lights.size()) - 1;
}

int GltfBuilder::triangle(const std::vector<float>& positions, const json& node_extra,
                          int material_index) {
  json primitive = {{"attributes", {{"POSITION", floats("VEC3", positions)}}}};
  primitive["material"] = material_index < 0 ? material(matte()) : material_index;
  json added = node_extra;
  added["mesh"] = mesh(primitive);
  return node(added);
}

json GltfBuilder::finished() const {
  json result = root;
  if (!bin.empty() && !result.contains("buffers"))
    result["buffers"] = json::array({{{"byteLength", bin.size()}}});
  return result;
}

void GltfBuilder::writeGltf(const fs::path& path) const {
  json result = finished();
  if (!bin.empty() && !result["buffers"][0].contains("uri")) {
    const fs::path bin_path = fs::path(path).replace_extension(".bin");
    result["buffers"][0]["uri"] = bin_path.filename().string();
    writeBytes(bin_path, bin);
  }
  writeBytes(path, result.dump());
}

std::string GltfBuilder::glb() const {
  std::string text = finished().dump();
  while (text.size() % 4 != 0) text += ' ';
  std::string data = bin;
  while (data.size() % 4 != 0) data += '\0';
  std::string chunks = littleEndian(static_cast<uint32_t>(text.size())) + "JSON" + text;
  if (!data.empty())
    chunks += littleEndian(static_cast<uint32_t>(data.size())) + std::string("BIN\0", 4) + data;
  return "glTF" + littleEndian(2) + littleEndian(static_cast<uint32_t>(chunks.size()) + 12) +
         chunks;
}

void GltfBuilder::writeGlb(const fs::path& path) const { writeBytes(path, glb()); }

json matte() { return {{"pbrMetallicRoughness", {{"metallicFactor", 0}}}}; }

Scene loadGlb(const GltfBuilder& gltf) {
  const TemporaryFolder folder;
  gltf.writeGlb(folder / "scene.glb");
  return loadScene(folder / "scene.glb");
}

std::string loadError(const fs::path& path) {
  try {
    loadScene(path);
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
    return e.what();
  }
  ADD_FAILURE() << path << " loads, an error was expected";
  return "";
}

Vec3d corner(const Scene& scene, std::size_t triangle, int corner) {
  const Geometry& g = *scene.geometry;
  return toWorld(scene, g.positions.at(g.triangles.at(triangle).vertex[corner]));
}

bool warns(const Scene& scene, const std::string& text) {
  return std::any_of(scene.warnings.begin(), scene.warnings.end(), [&](const std::string& warning) {
    return warning.find(text) != std::string::npos;
  });
}

}  // namespace probelab::test
