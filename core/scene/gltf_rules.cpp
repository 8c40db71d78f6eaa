// SPDX-License-Identifier: Apache-2.0
// Source: the glTF 2.0 specification's property reference and the extensions' schemas.
#include "gltf_rules.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/error.h"
#include "warnings.h"

namespace probelab {
using nlohmann::json;
namespace {

constexpr bool kRequired = true;
constexpr auto kNumber = GltfKind::number;
constexpr auto kNumbers = GltfKind::numbers;
constexpr auto kSize = GltfKind::size;
constexpr auto kIndex = GltfKind::index;
constexpr auto kText = GltfKind::text;
constexpr auto kBoolean = GltfKind::boolean;
constexpr auto kArray = GltfKind::array;
constexpr auto kObject = GltfKind::object;
constexpr const char* kLights = "extensions/KHR_lights_punctual/lights";

// Largest integer that every reader behind us holds exactly.
constexpr double kMaxSize = 9007199254740991.0;

// The same four rules for each place that names a texture.
#define PROBELAB_TEXTURE_RULES(where)                                             \
  {where "/index", kIndex, kRequired, 0, "textures"}, {where "/texCoord", kSize}, \
      {where "/extensions/KHR_texture_transform/offset", kNumbers, false, 2},     \
      {where "/extensions/KHR_texture_transform/scale", kNumbers, false, 2},      \
      {where "/extensions/KHR_texture_transform/rotation", kNumber}, {            \
    where "/extensions/KHR_texture_transform/texCoord", kSize                     \
  }

constexpr GltfRule kRules[] = {
    {"asset", kObject, kRequired},
    {"asset/version", kText, kRequired},
    {"extensionsUsed/[]", kText},
    {"extensionsRequired/[]", kText},
    {"scene", kIndex, false, 0, "scenes"},
    {"scenes/[]/nodes/[]", kIndex, false, 0, "nodes"},
    {"nodes/[]/name", kText},
    {"nodes/[]/children/[]", kIndex, false, 0, "nodes"},
    {"nodes/[]/mesh", kIndex, false, 0, "meshes"},
    {"nodes/[]/camera", kIndex, false, 0, "cameras"},
    {"nodes/[]/skin", kIndex, false, 0, "skins"},
    {"nodes/[]/matrix", kNumbers, false, 16},
    {"nodes/[]/translation", kNumbers, false, 3},
    {"nodes/[]/rotation", kNumbers, false, 4},
    {"nodes/[]/scale", kNumbers, false, 3},
    {"nodes/[]/extensions/KHR_lights_punctual/light", kIndex, kRequired, 0, kLights},
    {"meshes/[]/name", kText},
    {"meshes/[]/primitives", kArray, kRequired},
    {"meshes/[]/primitives/[]/attributes", kObject, kRequired},
    {"meshes/[]/primitives/[]/attributes/*", kIndex, false, 0, "accessors"},
    {"meshes/[]/primitives/[]/indices", kIndex, false, 0, "accessors"},
    {"meshes/[]/primitives/[]/material", kIndex, false, 0, "materials"},
    {"meshes/[]/primitives/[]/mode", kSize},
    {"meshes/[]/primitives/[]/targets", kArray},
    {"accessors/[]/bufferView", kIndex, false, 0, "bufferViews"},
    {"accessors/[]/byteOffset", kSize},
    {"accessors/[]/componentType", kSize, kRequired},
    {"accessors/[]/count", kSize, kRequired},
    {"accessors/[]/type", kText, kRequired},
    {"accessors/[]/normalized", kBoolean},
    {"accessors/[]/sparse/count", kSize, kRequired},
    {"accessors/[]/sparse/indices", kObject, kRequired},
    {"accessors/[]/sparse/indices/bufferView", kIndex, kRequired, 0, "bufferViews"},
    {"accessors/[]/sparse/indices/byteOffset", kSize},
    {"accessors/[]/sparse/indices/componentType", kSize, kRequired},
    {"accessors/[]/sparse/values", kObject, kRequired},
    {"accessors/[]/sparse/values/bufferView", kIndex, kRequired, 0, "bufferViews"},
    {"accessors/[]/sparse/values/byteOffset", kSize},
    {"buffers/[]/byteLength", kSize, kRequired},
    {"buffers/[]/uri", kText},
    {"bufferViews/[]/buffer", kIndex, kRequired, 0, "buffers"},
    {"bufferViews/[]/byteLength", kSize, kRequired},
    {"bufferViews/[]/byteOffset", kSize},
    {"bufferViews/[]/byteStride", kSize},
    {"images/[]/name", kText},
    {"images/[]/uri", kText},
    {"images/[]/bufferView", kIndex, false, 0, "bufferViews"},
    {"textures/[]/source", kIndex, false, 0, "images"},
    {"textures/[]/sampler", kIndex, false, 0, "samplers"},
    {"samplers/[]/wrapS", kSize},
    {"samplers/[]/wrapT", kSize},
    {"samplers/[]/magFilter", kSize},
    {"materials/[]/name", kText},
    {"materials/[]/pbrMetallicRoughness/baseColorFactor", kNumbers, false, 4},
    {"materials/[]/pbrMetallicRoughness/metallicFactor", kNumber},
    PROBELAB_TEXTURE_RULES("materials/[]/pbrMetallicRoughness/baseColorTexture"),
    PROBELAB_TEXTURE_RULES("materials/[]/pbrMetallicRoughness/metallicRoughnessTexture"),
    PROBELAB_TEXTURE_RULES("materials/[]/emissiveTexture"),
    {"materials/[]/emissiveFactor", kNumbers, false, 3},
    {"materials/[]/alphaMode", kText},
    {"materials/[]/alphaCutoff", kNumber},
    {"materials/[]/doubleSided", kBoolean},
    {"materials/[]/extensions/KHR_materials_emissive_strength/emissiveStrength", kNumber},
    {"cameras/[]/name", kText},
    {"cameras/[]/type", kText, kRequired},
    {"cameras/[]/perspective/yfov", kNumber, kRequired},
    {"extensions/KHR_lights_punctual/lights/[]/type", kText, kRequired},
    {"extensions/KHR_lights_punctual/lights/[]/name", kText},
    {"extensions/KHR_lights_punctual/lights/[]/color", kNumbers, false, 3},
    {"extensions/KHR_lights_punctual/lights/[]/intensity", kNumber},
    {"extensions/KHR_lights_punctual/lights/[]/range", kNumber},
    {"extensions/KHR_lights_punctual/lights/[]/spot/innerConeAngle", kNumber},
    {"extensions/KHR_lights_punctual/lights/[]/spot/outerConeAngle", kNumber},
    {"animations/[]/name", kText},
    {"animations/[]/channels/[]/sampler", kSize, kRequired},
    {"animations/[]/channels/[]/target", kObject, kRequired},
    {"animations/[]/channels/[]/target/node", kIndex, kRequired, 0, "nodes"},
    {"animations/[]/channels/[]/target/path", kText, kRequired},
    {"animations/[]/samplers/[]/input", kIndex, kRequired, 0, "accessors"},
    {"animations/[]/samplers/[]/output", kIndex, kRequired, 0, "accessors"},
    {"animations/[]/samplers/[]/interpolation", kText},
    {"skins/[]", kObject},
};
#undef PROBELAB_TEXTURE_RULES

std::size_t arraySize(const json& root, std::string_view path) {
  const json* at = &root;
  while (!path.empty()) {
    const std::size_t slash = path.find('/');
    const auto it = at->find(std::string(path.substr(0, slash)));
    if (it == at->end()) return 0;
    at = &*it;
    path = slash == std::string_view::npos ? "" : path.substr(slash + 1);
  }
  return at->is_array() ? at->size() : 0;
}

struct RuleCheck {
  const std::string& file;
  const json& root;
  const GltfRule& rule;
  std::size_t target_size;

  [[noreturn]] void fail(const std::string& where, const std::string& what) const {
    throwInput("{}: {}: {}", file, printable(where), what);
  }

  void checkSize(const json& value, const std::string& where) const {
    const bool integral =
        value.is_number_unsigned() ||
        (value.is_number_float() && std::floor(value.get<double>()) == value.get<double>());
    if (!value.is_number() || !integral || value.get<double>() < 0 ||
        value.get<double>() > kMaxSize)
      fail(where, fmt::format("must be an integer from 0, is {}", printable(value.dump(), 40)));
    // tinygltf takes integers only.
    if (value.is_number_float())
      fail(where, fmt::format("must be written as an integer, is {}", value.dump()));
    if (rule.kind == GltfKind::index && value.get<std::size_t>() >= target_size)
      fail(where,
           fmt::format("is {}, but there are {} {}", value.dump(), target_size, rule.target));
    const std::string_view path = rule.path;
    const bool narrow = path.ends_with("Type") || path.ends_with("/mode") ||
                        path.find("sparse") != path.npos || path.ends_with("sampler") ||
                        path.ends_with("texCoord") || path.starts_with("samplers");
    if (narrow && value.get<std::size_t>() > 0x7fffffff)
      fail(where, fmt::format("is {}, more than can be meant", value.dump()));
  }

  void checkNumbers(const json& value, const std::string& where) const {
    const bool fits = value.is_array() && value.size() == static_cast<std::size_t>(rule.length);
    if (!fits) fail(where, fmt::format("must be {} numbers", rule.length));
    for (const json& number : value)
      if (!number.is_number()) fail(where, fmt::format("must be {} numbers", rule.length));
  }

  void checkValue(const json& value, const std::string& where) const {
    switch (rule.kind) {
      case GltfKind::number:
        if (!value.is_number()) fail(where, "must be a number");
        break;
      case GltfKind::numbers:
        checkNumbers(value, where);
        break;
      case GltfKind::size:
      case GltfKind::index:
        checkSize(value, where);
        break;
      case GltfKind::text:
        if (!value.is_string()) fail(where, "must be a string");
        break;
      case GltfKind::boolean:
        if (!value.is_boolean()) fail(where, "must be true or false");
        break;
      case GltfKind::array:
        if (!value.is_array()) fail(where, "must be an array");
        break;
      case GltfKind::object:
        if (!value.is_object()) fail(where, "must be an object");
        break;
    }
  }

  // The recursion is as deep as the rule's path.
  void visit(const json& at, std::string_view rest, const std::string& where) const {
    const std::size_t slash = rest.find('/');
    const std::string step(rest.substr(0, slash));
    const bool last = slash == std::string_view::npos;
    const auto descend = [&](const json& child, const std::string& place) {
      if (last)
        checkValue(child, place);
      else
        visit(child, rest.substr(slash + 1), place);
    };
    if (step == "[]") {
      if (!at.is_array()) fail(where, "must be an array");
      for (std::size_t i = 0; i < at.size(); ++i) descend(at[i], fmt::format("{}[{}]", where, i));
      return;
    }
    if (!at.is_object()) fail(where, "must be an object");
    if (step == "*") {
      for (const auto& [key, child] : at.items()) descend(child, where + "." + key);
      return;
    }
    const std::string place = where.empty() ? step : where + "." + step;
    const auto it = at.find(step);
    if (it != at.end())
      descend(*it, place);
    else if (last && rule.required)
      fail(place, "is missing");
  }
};

}  // namespace

std::span<const GltfRule> gltfRules() { return kRules; }

void checkGltfRule(const std::string& file, const json& root, const GltfRule& rule) {
  const RuleCheck check{file, root, rule, arraySize(root, rule.target)};
  check.visit(root, rule.path, "");
}

}  // namespace probelab
