// SPDX-License-Identifier: GPL-3.0-or-later
// Only nodes and points: the whole of glTF is core/scene's. Nothing in the file is trusted.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"
#include "base/files.h"
#include "probe_files.h"

namespace probelab {
namespace {

using Json = nlohmann::json;
constexpr std::size_t kMostPoints = std::size_t{1} << 24;
constexpr int kMostDepth = 1000;

struct File {
  std::filesystem::path path;
  std::string name;
  Json root;
  std::string binary;  // a GLB's own chunk
};

uint32_t readU32(const std::string& bytes, std::size_t at) {
  uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, 4);
  return value;
}

File openFile(const std::filesystem::path& path) {
  File file{path, path.string(), {}, {}};
  const std::string bytes = readTextFile(path);
  std::string_view json = bytes;
  if (bytes.starts_with("glTF")) {
    if (bytes.size() < 20 || readU32(bytes, 4) != 2 || readU32(bytes, 16) != 0x4E4F534A)
      throwInput("{}: not a GLB of version 2 that begins with JSON", file.name);
    const std::size_t json_bytes = readU32(bytes, 12);
    if (json_bytes > bytes.size() - 20) throwInput("{}: the GLB is truncated", file.name);
    json = std::string_view(bytes).substr(20, json_bytes);
    const std::size_t next = 20 + json_bytes;
    if (bytes.size() - next >= 8 && readU32(bytes, next + 4) == 0x004E4942) {
      const std::size_t length = readU32(bytes, next);
      if (length > bytes.size() - next - 8) throwInput("{}: the GLB is truncated", file.name);
      file.binary = bytes.substr(next + 8, length);
    }
  }
  file.root = Json::parse(json, nullptr, false);
  if (!file.root.is_object()) throwInput("{}: its JSON cannot be read", file.name);
  return file;
}

// object[name] as an array of objects; empty when it is missing.
const Json& arrayOf(const File& file, const char* name) {
  static const Json kNone = Json::array();
  const auto found = file.root.find(name);
  if (found == file.root.end()) return kNone;
  if (!found->is_array()) throwInput("{}: {} is not an array", file.name, name);
  for (const Json& element : *found)
    if (!element.is_object())
      throwInput("{}: {} has an element that is no object", file.name, name);
  return *found;
}

std::optional<std::size_t> indexIn(const File& file, const Json& object, const char* key,
                                   std::size_t size, const std::string& element) {
  const auto found = object.find(key);
  if (found == object.end()) return std::nullopt;
  if (!found->is_number_unsigned() || found->get<std::size_t>() >= size)
    throwInput("{}: {}: {} names nothing in the file", file.name, element, key);
  return found->get<std::size_t>();
}

std::size_t countOf(const File& file, const Json& object, const char* key, std::size_t missing,
                    const std::string& element) {
  const auto found = object.find(key);
  if (found == object.end()) return missing;
  if (!found->is_number_unsigned() || found->get<std::size_t>() > (std::size_t{1} << 40))
    throwInput("{}: {}: {} is not a whole number", file.name, element, key);
  return found->get<std::size_t>();
}

// N finite numbers, or nothing when the key is missing.
template <std::size_t N>
bool readNumbers(const File& file, const Json& object, const char* key, double (&values)[N],
                 const std::string& element) {
  const auto found = object.find(key);
  if (found == object.end()) return false;
  bool right = found->is_array() && found->size() == N;
  for (std::size_t i = 0; right && i < N; ++i) {
    right = (*found)[i].is_number();
    if (right) values[i] = (*found)[i].get<double>();
    right = right && std::isfinite(values[i]);
  }
  if (!right) throwInput("{}: {}: {} is not {} finite numbers", file.name, element, key, N);
  return true;
}

Mat4d nodeTransform(const File& file, const Json& node, const std::string& element) {
  Mat4d result;
  double m[16], t[3] = {0, 0, 0}, q[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
  if (readNumbers(file, node, "matrix", m, element)) {
    for (int i = 0; i < 16; ++i) result.m[i % 4][i / 4] = m[i];
    return result;
  }
  readNumbers(file, node, "translation", t, element);
  readNumbers(file, node, "rotation", q, element);
  readNumbers(file, node, "scale", s, element);
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(norm > 0)) throwInput("{}: {}: its rotation is zero", file.name, element);
  for (double& v : q) v /= norm;
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  const double r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                          {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                          {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) result.m[i][j] = r[i][j] * s[j];
    result.m[i][3] = t[i];
  }
  return result;
}

std::string decodeBase64(const File& file, std::string_view text) {
  std::string bytes;
  uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    if (c == '=') break;
    const std::string_view digits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const std::size_t digit = digits.find(c);
    if (digit == std::string_view::npos) throwInput("{}: a data URI is not base64", file.name);
    bits = bits << 6 | static_cast<uint32_t>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes.push_back(static_cast<char>(bits >> count & 0xff));
  }
  return bytes;
}

std::string bufferBytes(const File& file, std::size_t index) {
  const Json& buffer = arrayOf(file, "buffers")[index];
  const auto uri = buffer.find("uri");
  if (uri == buffer.end()) return file.binary;
  if (!uri->is_string()) throwInput("{}: buffer {}: its uri is no text", file.name, index);
  const auto& text = uri->get_ref<const std::string&>();
  if (text.starts_with("data:")) {
    const std::size_t comma = text.find(";base64,");
    if (comma == std::string::npos)
      throwInput("{}: buffer {}: its data URI is not base64", file.name, index);
    return decodeBase64(file, std::string_view(text).substr(comma + 8));
  }
  const std::filesystem::path name(text);
  if (name.empty() || name.has_parent_path() || name == ".." || text.find(':') != std::string::npos)
    throwInput("{}: buffer {}: {} is not a file beside it", file.name, index, text);
  return readTextFile(file.path.parent_path() / name);
}

void addPoints(const File& file, std::size_t accessor_index, const Mat4d& to_world,
               FilePoints& points) {
  const std::string element = fmt::format("accessor {}", accessor_index);
  const Json& accessor = arrayOf(file, "accessors")[accessor_index];
  const Json& views = arrayOf(file, "bufferViews");
  const std::size_t count = countOf(file, accessor, "count", 0, element);
  if (count > kMostPoints || accessor.value("type", Json()) != "VEC3" ||
      accessor.value("componentType", Json()) != 5126 || accessor.contains("sparse"))
    throwInput("{}: {}: points are plain VEC3 of FLOAT", file.name, element);
  const auto view_index = indexIn(file, accessor, "bufferView", views.size(), element);
  if (!view_index) throwInput("{}: {}: it has no bufferView", file.name, element);
  const Json& view = views[*view_index];
  const auto buffer =
      indexIn(file, view, "buffer", arrayOf(file, "buffers").size(), "a bufferView");
  if (!buffer) throwInput("{}: bufferView {}: it has no buffer", file.name, *view_index);
  const std::string bytes = bufferBytes(file, *buffer);
  const std::size_t stride = countOf(file, view, "byteStride", 12, "a bufferView");
  const std::size_t begin = countOf(file, view, "byteOffset", 0, "a bufferView") +
                            countOf(file, accessor, "byteOffset", 0, element);
  // None of these can overflow: count is below 2^25, and the others are below 2^42.
  const std::size_t end =
      std::min(bytes.size(), countOf(file, view, "byteOffset", 0, "a bufferView") +
                                 countOf(file, view, "byteLength", bytes.size(), "a bufferView"));
  const bool fits =
      begin + 12 <= end && (count <= 1 || stride <= (end - begin - 12) / (count - 1));
  if (stride < 12 || (count > 0 && !fits))
    throwInput("{}: {}: it reaches beyond its bufferView", file.name, element);
  for (std::size_t i = 0; i < count; ++i) {
    float p[3];
    std::memcpy(p, bytes.data() + begin + i * stride, 12);
    points.world.push_back(transformPoint(to_world, Vec3d(Vec3f(p[0], p[1], p[2]))));
    points.pinned.push_back(0);
  }
}

// "probe", "probe 12", "probe.001", but not "probes" or "probelab".
bool isProbeName(const std::string& name) {
  return name.starts_with("probe") &&
         (name.size() == 5 || std::isalpha(static_cast<unsigned char>(name[5])) == 0);
}

class Walk {
 public:
  Walk(const File& file, FilePoints& points)
      : file_(file), points_(points), nodes_(arrayOf(file, "nodes")), seen_(nodes_.size()) {}

  void visit(std::size_t index, const Mat4d& parent, int depth) {
    const Json& node = nodes_[index];
    const std::string element = fmt::format("node {}", index);
    if (seen_[index])
      throwInput("{}: {}: it has two parents or is its own", file_.name, element);
    if (depth > kMostDepth)
      throwInput("{}: {}: it lies more than {} nodes deep", file_.name, element, kMostDepth);
    seen_[index] = true;
    const Mat4d to_world = parent * nodeTransform(file_, node, element);
    const auto name = node.find("name");
    if (name != node.end() && name->is_string() && isProbeName(name->get_ref<const std::string&>()))
      addNode(node, to_world);
    else
      addMesh(node, to_world, element);
    const auto children = node.find("children");
    if (children == node.end()) return;
    if (!children->is_array()) throwInput("{}: {}: children is no array", file_.name, element);
    for (const Json& child : *children) visit(checked(child, element), to_world, depth + 1);
  }
  std::size_t checked(const Json& node, const std::string& element) const {
    if (!node.is_number_unsigned() || node.get<std::size_t>() >= nodes_.size())
      throwInput("{}: {}: names a node that is not there", file_.name, element);
    return node.get<std::size_t>();
  }

 private:
  void addNode(const Json& node, const Mat4d& to_world) {
    const auto extras = node.find("extras");
    const Json pin = extras != node.end() && extras->is_object() ? extras->value("pinned", Json())
                                                                 : Json();
    const bool pinned = pin == Json(true) || pin == Json(1);
    points_.world.push_back(transformPoint(to_world, Vec3d()));
    points_.pinned.push_back(pinned ? 1 : 0);
  }
  void addMesh(const Json& node, const Mat4d& to_world, const std::string& element) {
    const Json& meshes = arrayOf(file_, "meshes");
    const auto mesh = indexIn(file_, node, "mesh", meshes.size(), element);
    if (!mesh) return;
    const auto primitives = meshes[*mesh].find("primitives");
    if (primitives == meshes[*mesh].end() || !primitives->is_array()) return;
    for (const Json& primitive : *primitives) {
      if (!primitive.is_object() || primitive.value("mode", Json(4)) != 0) continue;
      const auto attributes = primitive.find("attributes");
      if (attributes == primitive.end() || !attributes->is_object()) continue;
      const auto accessor = indexIn(file_, *attributes, "POSITION",
                                    arrayOf(file_, "accessors").size(), "a mesh of points");
      if (accessor) addPoints(file_, *accessor, to_world, points_);
    }
  }

  const File& file_;
  FilePoints& points_;
  const Json& nodes_;
  std::vector<bool> seen_;
};

}  // namespace

FilePoints readGltfPoints(const std::filesystem::path& path) {
  const File file = openFile(path);
  FilePoints points;
  const Json& scenes = arrayOf(file, "scenes");
  const std::size_t scene = indexIn(file, file.root, "scene", scenes.size(), "scene").value_or(0);
  if (scenes.empty()) throwInput("{}: it has no scene", file.name);
  Walk walk(file, points);
  const auto roots = scenes[scene].find("nodes");
  if (roots != scenes[scene].end()) {
    if (!roots->is_array()) throwInput("{}: scene {}: nodes is no array", file.name, scene);
    for (const Json& root : *roots) walk.visit(walk.checked(root, "a scene"), Mat4d(), 0);
  }
  for (const Vec3d& p : points.world)
    if (!isFinite(p)) throwInput("{}: a position is not finite", file.name);
  return points;
}

}  // namespace probelab
