// SPDX-License-Identifier: GPL-3.0-or-later
#include "shader_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "ddgi/field_constants.h"
#include "ddgi/scene_buffers.h"
#include "gpu/shader.h"
#include "table.h"

namespace probelab {
namespace {

using Names = std::vector<std::string>;

SceneFeatures allFeatures() {
  SceneFeatures f;
  f.triangles = f.textures = f.alpha_mask = f.double_sided = f.emission = f.shading_normals = true;
  f.sky = f.sky_linear = f.sky_image = true;
  f.directional_lights = f.point_lights = f.spot_lights = true;
  return f;
}

// The parameters with every part of the query switched on that can be.
Params allParts(Params params) {
  params.visibility = params.feedback = 1;
  if (params.facing == 0) params.facing = PL_FACING_WRAP;
  if (params.crush == 0) params.crush = PL_CRUSH_AFTER_TRILINEAR;
  if (params.trilinear == 0) params.trilinear = PL_TRILINEAR_AXIS_MAX;
  params.fallback = PL_FALLBACK_LERP_UNOCCLUDED;
  params.relocation = params.offset_weights = 1;
  params.radiance_clamp = 1;
  params.texture_footprint = 1;
  return params;
}

bool hasLights(const SceneFeatures& f) {
  return f.directional_lights || f.point_lights || f.spot_lights;
}

std::size_t wordsOf(const std::string& shader, Defines defines, const Names& inputs) {
  for (std::size_t i = 0; i < inputs.size(); ++i)
    defines.emplace_back("BIND_" + inputs[i], std::to_string(i));
  return compileShader({shader, std::move(defines), {}}).size();
}

// Buffers by what has to be in use for them.
std::vector<std::pair<std::string, bool>> sceneBufferUse(const SceneFeatures& f) {
  return {{"TRIANGLES", f.triangles}, {"POSITIONS", f.triangles},
          {"MATERIALS", f.triangles}, {"NORMALS", f.triangles && f.shading_normals},
          {"UV0", f.textures},        {"UV1", f.textures},
          {"TEXELS", f.textures},     {"SKY", f.sky},
          {"SKY_IMAGE", f.sky_image}};
}

std::size_t shadeWords(const SceneFeatures& features, const Params& params) {
  Defines defines = sceneDefines(features);
  if (features.textures && params.texture_footprint > 0)
    defines.emplace_back("PL_TEXTURE_LOD", "1");
  return wordsOf("ddgi/shade.comp.glsl", defines, features.sky ? Names{"SKY"} : Names{});
}

std::size_t lightWords(const SceneFeatures& features, int pass) {
  Defines defines = sceneDefines(features);
  defines.emplace_back("PL_LIGHT_PASS", std::to_string(pass));
  return wordsOf("ddgi/light.comp.glsl", defines, {"LIGHTS"});
}

LayoutUse layoutUse(const Params& params) { return {.moved = params.relocation != 0}; }

std::size_t queryWords(const Params& params) {
  return wordsOf("ddgi/query.comp.glsl", fieldDefines(params, layoutUse(params)),
                 {"FIELD", "COUNTERS", "RESULTS"});
}

std::size_t resolveWords(const Params& params) {
  return wordsOf("ddgi/resolve.comp.glsl",
                 resolveDefines(params, layoutUse(params), RayUse::probes), {"FIELD", "COUNTERS"});
}

Json partsJson(const SceneFeatures& f, const Params& p) {
  return {{"textures", f.textures},
          {"texture_footprint", f.textures && p.texture_footprint > 0},
          {"alpha_mask", f.alpha_mask},
          {"double_sided", f.double_sided},
          {"emission", f.emission},
          {"shading_normals", f.shading_normals},
          {"sky", f.sky},
          {"sky_image", f.sky_image},
          {"directional_lights", f.directional_lights},
          {"point_lights", f.point_lights},
          {"spot_lights", f.spot_lights},
          {"feedback", p.feedback != 0},
          {"visibility", p.visibility != 0},
          {"facing", p.facing != 0},
          {"crush", p.crush != 0},
          {"fallback", p.fallback != 0},
          {"moved_probes", p.relocation != 0},
          {"radiance_clamp", p.radiance_clamp > 0}};
}

Json absentBuffers(const SceneFeatures& features, const Params& params) {
  Json absent = Json::array();
  for (const auto& [name, used] : sceneBufferUse(features))
    if (!used) absent.push_back(name);
  if (!hasLights(features))
    for (const char* name : {"LIGHTS", "SHADOW_RAYS", "OCCLUDED"}) absent.push_back(name);
  if (params.visibility == 0)
    for (const char* name : {"moment atlas"}) absent.push_back(name);
  if (params.fallback != PL_FALLBACK_NEAREST) absent.push_back("nearest probes");
  return absent;
}

Names namesOf(const Json& parts, bool wanted) {
  Names names;
  for (const auto& [name, in] : parts.items())
    if (in.get<bool>() == wanted) names.push_back(name);
  return names;
}

std::string joined(const Names& names) {
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

Json shaderReport(const Scene& scene, const Params& params) {
  const SceneFeatures features = sceneFeatures(scene), all = allFeatures();
  const Params full = allParts(params);
  Json stages = Json::array();
  const auto add = [&](const char* name, std::size_t words, std::size_t full_words) {
    stages.push_back({{"stage", name}, {"words", words}, {"full_words", full_words}});
  };
  add("shade", shadeWords(features, params), shadeWords(all, full));
  if (hasLights(features)) {
    add("shadow rays", lightWords(features, 0), lightWords(all, 0));
    add("add light", lightWords(features, 1), lightWords(all, 1));
  }
  add("resolve", resolveWords(params), resolveWords(full));
  add("query", queryWords(params), queryWords(full));
  return {{"params", params.name},
          {"parts", partsJson(features, params)},
          {"absent_buffers", absentBuffers(features, params)},
          {"stages", stages}};
}

std::string formatShaders(const Json& report) {
  TextTable table({"stage", "SPIR-V words", "with every part", "share"});
  for (const Json& stage : report["stages"])
    table.addRow({stage["stage"].get<std::string>(), stage["words"].dump(),
                  stage["full_words"].dump(),
                  fmt::format("{:.0f} %", 100 * stage["words"].get<double>() /
                                              stage["full_words"].get<double>())});
  return formatFields({{"parameters", report["params"].get<std::string>()},
                       {"compiled in", joined(namesOf(report["parts"], true))},
                       {"left out", joined(namesOf(report["parts"], false))},
                       {"absent buffers", joined(report["absent_buffers"].get<Names>())}}) +
         table.text();
}

}  // namespace probelab
