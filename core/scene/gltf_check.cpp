// SPDX-License-Identifier: Apache-2.0
#include "gltf_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/files.h"
#include "gltf_rules.h"

namespace probelab {
namespace fs = std::filesystem;
using nlohmann::json;
namespace {

constexpr int kMaxNesting = 64;

// Extensions whose meaning the loader honours.
constexpr std::array kUnderstood = {"KHR_lights_punctual", "KHR_materials_emissive_strength",
                                    "KHR_texture_transform", "KHR_mesh_quantization"};
// They refine what a diffuse renderer leaves out; a file may require them and still load.
constexpr std::array kIgnorable = {
    "KHR_materials_unlit",      "KHR_materials_ior",         "KHR_materials_specular",
    "KHR_materials_clearcoat",  "KHR_materials_sheen",       "KHR_materials_transmission",
    "KHR_materials_volume",     "KHR_materials_iridescence", "KHR_materials_anisotropy",
    "KHR_materials_dispersion", "KHR_materials_variants",    "KHR_xmp_json_ld"};
constexpr std::array kCompressed = {"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                    "KHR_meshopt_compression"};
constexpr std::array kDataUris = {"data:application/octet-stream;base64,",
                                  "data:application/gltf-buffer;base64,", "data:text/plain;base64,",
                                  "data:image/png;base64,", "data:image/jpeg;base64,"};

template <class List>
bool contains(const List& list, const std::string& name) {
  for (const char* entry : list)
    if (name == entry) return true;
  return false;
}

bool startsWith(const std::string& text, std::string_view prefix) {
  return text.compare(0, prefix.size(), prefix) == 0;
}

// What tinygltf's decoder makes of the text behind the comma.
std::size_t decodedLength(const std::string& uri, std::size_t begin) {
  std::size_t n = begin;
  while (n < uri.size() &&
         (std::isalnum(static_cast<unsigned char>(uri[n])) || uri[n] == '+' || uri[n] == '/'))
    ++n;
  return (n - begin) * 3 / 4;
}

// Length of the data in a data URI; nothing when `uri` is none. Throws for kinds that are not read.
std::optional<std::size_t> dataUriLength(const std::string& file, const std::string& element,
                                         const std::string& uri) {
  if (!startsWith(uri, "data:")) return std::nullopt;
  for (const std::string_view prefix : kDataUris)
    if (startsWith(uri, prefix)) return decodedLength(uri, prefix.size());
  throwInput("{}: {}: '{}' is a data URI of a kind that is not read; use {} and so on", file,
             element, printable(uri, 40), kDataUris[0]);
}

void checkBuffer(const std::string& file, const json& buffer, const std::string& element,
                 bool in_chunk, std::size_t bin_bytes, FileGuard& guard) {
  const auto declared = buffer.at("byteLength").get<std::size_t>();
  std::size_t available = bin_bytes;
  std::string place = "the GLB's binary chunk";
  if (buffer.contains("uri")) {
    const std::string uri = buffer.at("uri");
    if (const auto length = dataUriLength(file, element, uri)) {
      if (*length != declared)
        throwInput("{}: {}: byteLength is {}, but its data URI holds {} bytes", file, element,
                   declared, *length);
      return;
    }
    const fs::path path = guard.resolve(uri, element);
    std::error_code ec;
    available = fs::file_size(path, ec);
    if (ec || !isFile(path))
      throwInput("{}: {}: '{}': no such file", file, element, printable(uri));
    guard.declareLength(path, declared);
    place = fmt::format("'{}'", printable(uri));
  } else if (!in_chunk) {
    throwInput("{}: {}: has no uri, and there is no binary chunk that could hold it", file,
               element);
  }
  if (declared > available)
    throwInput("{}: {}: byteLength is {}, but {} has {} bytes; the file is truncated or damaged",
               file, element, declared, place, available);
}

void checkView(const std::string& file, const json& view, const std::string& element,
               const json& buffers) {
  const auto length = view.at("byteLength").get<std::size_t>();
  const auto offset = view.value("byteOffset", std::size_t{0});
  const auto stride = view.value("byteStride", std::size_t{0});
  const auto buffer = view.at("buffer").get<std::size_t>();
  const auto available = buffers.at(buffer).at("byteLength").get<std::size_t>();
  if (offset > available || length > available - offset)
    throwInput("{}: {}: byteOffset {} + byteLength {} run past the {} bytes of buffer {}", file,
               element, offset, length, available, buffer);
  if (stride % 4 != 0 || stride > 252)
    throwInput("{}: {}: byteStride {} is not a multiple of 4 up to 252", file, element, stride);
}

// How deep brackets nest, outside of strings. (The parser's own hook for this takes quadratic
// time.)
int nestingOf(std::string_view text) {
  int depth = 0, deepest = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string && c == '\\')
      ++i;
    else if (c == '"')
      in_string = !in_string;
    else if (!in_string && (c == '[' || c == '{'))
      deepest = std::max(deepest, ++depth);
    else if (!in_string && (c == ']' || c == '}'))
      --depth;
  }
  return deepest;
}

std::string nameOf(const json& object) {
  const auto it = object.find("name");
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string();
}

const json& arrayOf(const json& root, const char* key) {
  static const json empty = json::array();
  const auto it = root.find(key);
  return it != root.end() ? *it : empty;
}

}  // namespace

json parseGltfJson(const std::string& file, std::string_view text) {
  if (nestingOf(text) > kMaxNesting)
    throwInput("{}: its JSON is nested deeper than {} levels", file, kMaxNesting);
  try {
    json root = json::parse(text.begin(), text.end());
    if (!root.is_object()) throwInput("{}: is not a glTF: its JSON is not an object", file);
    return root;
  } catch (const json::exception& e) {
    const std::string what = e.what();
    const std::size_t prefix = what.find("] ");
    throwInput("{}: is not valid JSON: {}", file,
               printable(prefix == std::string::npos ? what : what.substr(prefix + 2)));
  }
}

void checkGltfStructure(const std::string& file, const json& root) {
  for (const GltfRule& rule : gltfRules()) checkGltfRule(file, root, rule);
}

void checkGltfExtensions(const std::string& file, const json& root, Warnings& warnings) {
  const std::string version = root.at("asset").at("version");
  if (!startsWith(version, "2."))
    throwInput("{}: is glTF version '{}'; version 2 is read", file, printable(version));
  for (const char* key : {"extensionsRequired", "extensionsUsed"})
    for (const json& entry : arrayOf(root, key)) {
      const std::string name = entry;
      if (contains(kCompressed, name))
        throwInput("{}: its geometry is compressed ({}); export it without compression", file,
                   printable(name));
      if (contains(kUnderstood, name)) continue;
      if (key == std::string("extensionsRequired") && !contains(kIgnorable, name))
        throwInput("{}: requires the extension {}, which is not supported; export without it", file,
                   printable(name));
      warnings.add("{}: the extension {} is ignored", file, printable(name));
    }
}

void checkGltfBuffers(const std::string& file, const json& root, bool glb, std::size_t bin_bytes,
                      FileGuard& guard) {
  const json& buffers = arrayOf(root, "buffers");
  const json& images = arrayOf(root, "images");
  // URIs first: a file that tries to leave its folder is refused before the disk is asked at all.
  for (const auto& [kind, list] : {std::pair{"buffer", &buffers}, std::pair{"image", &images}})
    for (std::size_t i = 0; i < list->size(); ++i) {
      const json& entry = list->at(i);
      const std::string element = elementName(kind, i, nameOf(entry));
      if (entry.contains("uri") && !dataUriLength(file, element, entry.at("uri")))
        guard.expect(entry.at("uri"), guard.resolve(entry.at("uri"), element));
    }
  for (std::size_t i = 0; i < buffers.size(); ++i)
    checkBuffer(file, buffers[i], elementName("buffer", i, nameOf(buffers[i])), glb && i == 0,
                bin_bytes, guard);
  const json& views = arrayOf(root, "bufferViews");
  for (std::size_t i = 0; i < views.size(); ++i)
    checkView(file, views[i], elementName("buffer view", i, nameOf(views[i])), buffers);
  for (std::size_t i = 0; i < images.size(); ++i)
    if (images[i].contains("uri") == images[i].contains("bufferView"))
      throwInput("{}: {}: needs either a uri or a bufferView", file,
                 elementName("image", i, nameOf(images[i])));
}

}  // namespace probelab
