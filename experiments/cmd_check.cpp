// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab check`: what a scene is made of, and what will go wrong with it.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "field_options.h"
#include "json.h"
#include "program.h"
#include "provenance.h"
#include "require.h"
#include "scene/load.h"
#include "scene_check.h"
#include "shader_report.h"
#include "table.h"

namespace probelab {
namespace {

struct CheckOptions {
  std::string scene;
  FieldOptions field;  // its parameters: what the shaders are specialised to
};

Json toJson(const Vec3d& v) { return {v.x, v.y, v.z}; }
Json toJson(const Box3d& box) { return {{"min", toJson(box.min)}, {"max", toJson(box.max)}}; }
Json worldBox(const Scene& scene, const Box3f& box) {
  return toJson(Box3d{toWorld(scene, box.min), toWorld(scene, box.max)});
}

Json toJson(const MeshEdges& edges) {
  return {{"name", edges.name},
          {"triangles", edges.triangles},
          {"closed", edges.closed()},
          {"boundary_edges", edges.boundary_edges},
          {"nonmanifold_edges", edges.nonmanifold_edges},
          {"inconsistent_edges", edges.inconsistent_edges}};
}

Json describeMesh(const MeshReport& report) {
  Json json = toJson(report.all);
  json["welded_vertices"] = report.welded_vertices;
  json["degenerate_triangles"] = report.degenerate_triangles;
  json["duplicate_triangles"] = report.duplicate_triangles;
  json["meshes"] = Json::array();
  for (const MeshEdges& edges : report.meshes) json["meshes"].push_back(toJson(edges));
  return json;
}

Json describeFeatures(const SceneFeatures& f) {
  return {{"triangles", f.triangles},
          {"textures", f.textures},
          {"alpha_mask", f.alpha_mask},
          {"double_sided", f.double_sided},
          {"emission", f.emission},
          {"shading_normals", f.shading_normals},
          {"sky", f.sky},
          {"sky_linear", f.sky_linear},
          {"sky_image", f.sky_image},
          {"directional_lights", f.directional_lights},
          {"point_lights", f.point_lights},
          {"spot_lights", f.spot_lights}};
}

Json describeWall(const Scene& scene, const WallThickness& wall) {
  if (!wall.has_walls) return {{"thinnest_m", nullptr}, {"sheet_share", wall.sheet_share}};
  return {{"thinnest_m", wall.thinnest_m},
          {"place", toJson(toWorld(scene, wall.place))},
          {"sheet_share", wall.sheet_share}};
}

Json describeRegions(const Scene& scene, const Reachability& reachability) {
  Json regions = Json::array();
  for (const Region& region : reachability.regions) {
    Json cameras = Json::array();
    for (const uint32_t camera : region.cameras) cameras.push_back(scene.cameras[camera].name);
    regions.push_back({{"volume_m3", region.volume_m3},
                       {"cells", region.cells},
                       {"box", worldBox(scene, region.box)},
                       {"reachable", region.reachable},
                       {"touches_bounds", region.touches_bounds},
                       {"inside_solid", region.inside_solid},
                       {"cameras", cameras},
                       {"seeds", region.seeds.size()}});
  }
  return regions;
}

const char* typeName(LightType type) {
  if (type == LightType::directional) return "directional";
  return type == LightType::point ? "point" : "spot";
}

Json describeLights(const Scene& scene) {
  Json lights = Json::array();
  for (const Light& light : scene.lights) {
    Json json = {{"name", light.name},
                 {"type", typeName(light.type)},
                 {"intensity", toJson(Vec3d(light.intensity))}};
    if (light.type != LightType::point) json["direction"] = toJson(Vec3d(light.direction));
    if (light.type != LightType::directional)
      json["position"] = toJson(toWorld(scene, light.position));
    lights.push_back(json);
  }
  return lights;
}

Json describeScene(const Scene& scene, const SceneCheck& check) {
  Json json = {{"scene", scene.name},
               {"path", scene.path},
               {"hash", scene.content_hash},
               {"triangles", scene.geometry->triangles.size()},
               {"vertices", scene.geometry->positions.size()},
               {"materials", scene.materials.size()},
               {"textures", scene.textures.size()},
               {"bounds", worldBox(scene, scene.bounds)},
               {"suggested_volume", toJson(check.suggested_volume)},
               {"mesh", describeMesh(check.mesh)},
               {"features", describeFeatures(check.features)},
               {"wall", describeWall(scene, check.wall)},
               {"regions", nullptr},
               {"lights", describeLights(scene)},
               {"cameras", Json::array()},
               {"states", Json::array()},
               {"warnings", check.warnings}};
  if (check.reachability) json["regions"] = describeRegions(scene, *check.reachability);
  for (const Camera& camera : scene.cameras)
    json["cameras"].push_back({{"name", camera.name},
                               {"position", toJson(toWorld(scene, camera.position))},
                               {"forward", toJson(Vec3d(camera.forward))}});
  for (const LightingState& state : scene.states)
    json["states"].push_back(
        {{"name", state.name}, {"split", state.split == Split::train ? "train" : "heldout"}});
  return json;
}

// From here on: the same as text.
std::string formatVector(const Json& v) {
  return fmt::format("({:.4g}, {:.4g}, {:.4g})", v[0].get<double>(), v[1].get<double>(),
                     v[2].get<double>());
}
std::string formatBox(const Json& box) {
  return formatVector(box["min"]) + " to " + formatVector(box["max"]) + " m";
}

std::string joinNames(const Json& items) {
  std::vector<std::string> names;
  for (const Json& item : items) names.push_back(item["name"].get<std::string>());
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

std::string formatWall(const Json& wall) {
  std::string text = "no wall has another face behind it";
  if (!wall["thinnest_m"].is_null())
    text = fmt::format("{:.4g} m at {}", wall["thinnest_m"].get<double>(),
                       formatVector(wall["place"]));
  const double sheets = wall["sheet_share"].get<double>();
  return sheets > 0 ? fmt::format("{}; {:.3g} % of the area are single sheets", text, 100 * sheets)
                    : text;
}

void printMeshes(const Json& mesh) {
  TextTable table({"mesh", "triangles", "boundary", "non-manifold", "inconsistent", "closed"});
  const auto add = [&](const Json& m, const std::string& name) {
    table.addRow({name, m["triangles"].dump(), m["boundary_edges"].dump(),
                  m["nonmanifold_edges"].dump(), m["inconsistent_edges"].dump(),
                  m["closed"].get<bool>() ? "yes" : "no"});
  };
  constexpr std::size_t kMostRows = 20;
  const Json& meshes = mesh["meshes"];
  for (std::size_t i = 0; i < std::min(kMostRows, meshes.size()); ++i)
    add(meshes[i], meshes[i]["name"].get<std::string>());
  if (meshes.size() > kMostRows)
    table.addRow({fmt::format("({} more)", meshes.size() - kMostRows)});
  add(mesh, "all, welded together");
  fmt::print("\nEdges\n{}", table.text());
}

void printRegions(const Json& regions) {
  if (regions.is_null()) return;
  TextTable table({"region", "volume m3", "reachable", "touches bounds", "in a solid", "cameras"});
  constexpr std::size_t kMostRows = 12;
  const auto yesNo = [](const Json& value) { return value.get<bool>() ? "yes" : "no"; };
  for (std::size_t i = 0; i < std::min(kMostRows, regions.size()); ++i) {
    const Json& r = regions[i];
    table.addRow({fmt::format("{}", i), formatNumber(r["volume_m3"].get<double>()),
                  yesNo(r["reachable"]), yesNo(r["touches_bounds"]), yesNo(r["inside_solid"]),
                  fmt::format("{}", r["cameras"].size())});
  }
  if (regions.size() > kMostRows)
    table.addRow({fmt::format("({} more)", regions.size() - kMostRows)});
  fmt::print("\nFree space\n{}", table.text());
}

void printScene(const Json& json) {
  std::vector<std::string> features;
  for (const auto& [name, used] : json["features"].items())
    if (used.get<bool>()) features.push_back(name);
  fmt::print("{}", formatFields(
                       {{"scene", json["scene"].get<std::string>()},
                        {"triangles", json["triangles"].dump()},
                        {"materials", fmt::format("{}, {} textures", json["materials"].dump(),
                                                  json["textures"].dump())},
                        {"features", fmt::format("{}", fmt::join(features, ", "))},
                        {"lights", joinNames(json["lights"])},
                        {"cameras", joinNames(json["cameras"])},
                        {"states", joinNames(json["states"])},
                        {"bounds", formatBox(json["bounds"])},
                        {"suggested volume", formatBox(json["suggested_volume"])},
                        {"thinnest wall", formatWall(json["wall"])},
                        {"welded vertices", json["mesh"]["welded_vertices"].dump()},
                        {"degenerate", json["mesh"]["degenerate_triangles"].dump() + " triangles"},
                        {"duplicate", json["mesh"]["duplicate_triangles"].dump() + " triangles"}}));
  printMeshes(json["mesh"]);
  printRegions(json["regions"]);
  fmt::print("\nShaders\n{}", formatShaders(json["shaders"]));
  if (json["warnings"].empty()) return;
  fmt::print("\nWarnings\n");
  for (const Json& warning : json["warnings"]) fmt::print("- {}\n", warning.get<std::string>());
}

void runCheck(const CheckOptions& options, const Invocation& invocation) {
  const Params params = resolveParams(options.field);
  const Scene scene = loadScene(options.scene);
  const EmbreeScene embree(scene);
  Json json = describeScene(scene, checkScene(scene, embree));
  json["shaders"] = shaderReport(scene, params);
  json["provenance"] = toJson(makeProvenance(invocation, scene));
  reportResult(invocation, json, [&] { printScene(json); });
}

}  // namespace

void addCheckCommand(Program& program) {
  auto options = std::make_shared<CheckOptions>();
  CLI::App& app = program.addCommand(
      "check", "mesh report, features in use, thinnest wall, free space, suggested volume, shaders",
      "probelab check scenes/two_rooms_door/scene.toml",
      [options](const Invocation& invocation) { runCheck(*options, invocation); });
  addSceneArgument(app, options->scene);
  addParamsOptions(app, options->field);
}

}  // namespace probelab
