// SPDX-License-Identifier: GPL-3.0-or-later
#include "probes_glb.h"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>

#include "base/build_info.h"
#include "base/files.h"
#include "json.h"

namespace probelab {
namespace {

constexpr const char* kGenerator = "probelab ";  // then the version
constexpr double kRadius = 0.1;                  // of a probe's bias length
constexpr std::array<std::array<float, 3>, 6> kCorners = {
    {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};
constexpr std::array<uint16_t, 24> kTriangles = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                                                 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};

enum class ProbeColor { active, pinned, inactive };
struct ColorName {
  const char* name;
  std::array<double, 3> rgb;
};
constexpr ColorName kColors[] = {
    {"active", {0.1, 0.7, 0.2}}, {"pinned", {1.0, 0.5, 0.0}}, {"inactive", {0.4, 0.4, 0.4}}};

Json probeNode(const ProbeLayout& layout, const Scene& scene, std::size_t i, ProbeColor color) {
  const Vec3d p = toWorld(scene, layout.positions[i]);
  const double radius = kRadius * static_cast<double>(probeLengths(layout, i).bias);
  Json node = {{"name", fmt::format("probe {}", i)},
               {"mesh", static_cast<int>(color)},
               {"translation", {p.x, p.y, p.z}},
               {"scale", {radius, radius, radius}}};
  if (color == ProbeColor::pinned) node["extras"] = {{"pinned", true}};
  return node;
}

// Corners, then triangles: both are multiples of 4 bytes long.
std::string meshBytes() {
  std::string bytes(sizeof(kCorners) + sizeof(kTriangles), '\0');
  std::memcpy(bytes.data(), kCorners.data(), sizeof(kCorners));
  std::memcpy(bytes.data() + sizeof(kCorners), kTriangles.data(), sizeof(kTriangles));
  return bytes;
}

Json describeMeshes() {
  constexpr int kFloat = 5126, kUnsignedShort = 5123, kVertices = 34962, kIndices = 34963;
  Json gltf = {{"asset", {{"version", "2.0"}, {"generator", kGenerator + buildInfo().version}}},
               {"buffers", Json::array({{{"byteLength", sizeof(kCorners) + sizeof(kTriangles)}}})}};
  gltf["bufferViews"] = {{{"buffer", 0}, {"byteLength", sizeof(kCorners)}, {"target", kVertices}},
                         {{"buffer", 0},
                          {"byteOffset", sizeof(kCorners)},
                          {"byteLength", sizeof(kTriangles)},
                          {"target", kIndices}}};
  gltf["accessors"] = {{{"bufferView", 0},
                        {"componentType", kFloat},
                        {"count", kCorners.size()},
                        {"type", "VEC3"},
                        {"min", {-1, -1, -1}},
                        {"max", {1, 1, 1}}},
                       {{"bufferView", 1},
                        {"componentType", kUnsignedShort},
                        {"count", kTriangles.size()},
                        {"type", "SCALAR"}}};
  gltf["materials"] = gltf["meshes"] = Json::array();
  for (const ColorName& color : kColors) {
    const std::string name = fmt::format("{} probe", color.name);
    const auto& [r, g, b] = color.rgb;
    gltf["meshes"].push_back({{"name", name},
                              {"primitives",
                               {{{"attributes", {{"POSITION", 0}}},
                                 {"indices", 1},
                                 {"material", gltf["materials"].size()}}}}});
    gltf["materials"].push_back(
        {{"name", name},
         {"emissiveFactor", {r / 4, g / 4, b / 4}},
         {"pbrMetallicRoughness", {{"baseColorFactor", {r, g, b, 1.0}}, {"metallicFactor", 0.0}}}});
  }
  return gltf;
}

std::string word(std::size_t value) {
  std::string bytes(4, '\0');
  for (std::size_t i = 0; i < 4; ++i) bytes[i] = static_cast<char>(value >> (8 * i) & 0xff);
  return bytes;
}

std::string glbBytes(const Json& gltf, const std::string& binary) {
  std::string text = gltf.dump();
  text.append((4 - text.size() % 4) % 4, ' ');
  const std::size_t total = 12 + 8 + text.size() + 8 + binary.size();
  return "glTF" + word(2) + word(total) + word(text.size()) + "JSON" + text + word(binary.size()) +
         std::string("BIN\0", 4) + binary;
}

constexpr std::size_t kJsonLengthAt = 12, kJsonAt = 20;  // in a GLB

std::size_t readWord(const std::string& bytes, std::size_t at) {
  std::size_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value |= static_cast<std::size_t>(static_cast<uint8_t>(bytes[at + i])) << (8 * i);
  return value;
}

}  // namespace

void writeProbesGlb(const std::filesystem::path& path, const ProbeLayout& layout,
                    const Scene& scene, const std::vector<uint8_t>& active) {
  Json gltf = describeMeshes();
  Json nodes = Json::array(), roots = Json::array();
  for (std::size_t i = 0; i < layout.positions.size(); ++i) {
    const bool pinned = !layout.pinned.empty() && layout.pinned[i] != 0;
    const bool inactive = !active.empty() && active[i] == 0;
    nodes.push_back(probeNode(layout, scene, i,
                              pinned     ? ProbeColor::pinned
                              : inactive ? ProbeColor::inactive
                                         : ProbeColor::active));
    roots.push_back(i);
  }
  gltf["nodes"] = std::move(nodes);
  gltf["scenes"] = Json::array({{{"name", "probes"}, {"nodes", std::move(roots)}}});
  gltf["scene"] = 0;
  writeTextFile(path, glbBytes(gltf, meshBytes()));
}

bool isProbesGlb(const std::filesystem::path& path) {
  const std::string bytes = readTextFile(path);
  if (bytes.size() < kJsonAt || !bytes.starts_with("glTF")) return false;
  const Json gltf = Json::parse(bytes.substr(kJsonAt, readWord(bytes, kJsonLengthAt)), nullptr,
                                /*allow_exceptions=*/false);
  const Json::json_pointer name("/asset/generator");
  return gltf.is_object() && gltf.contains(name) && gltf[name].is_string() &&
         gltf[name].get<std::string>().starts_with(kGenerator);
}

}  // namespace probelab
