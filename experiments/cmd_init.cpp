// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab init`: a commented scene TOML for a glTF file.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/files.h"
#include "commands.h"
#include "json.h"
#include "program.h"
#include "provenance.h"
#include "require.h"
#include "scene/init.h"
#include "scene/load.h"
#include "scene_check.h"
#include "table.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

struct InitOptions {
  std::string gltf, output;
  bool force = false;
};

void checkInput(const InitOptions& options) {
  const std::string extension = fs::path(options.gltf).extension().string();
  if (extension != ".glb" && extension != ".gltf")
    throwInput("{}: a .glb or .gltf file is needed", options.gltf);
  checkOutput(options.output, ".toml");
  std::error_code ec;
  if (fs::exists(options.output, ec) && !options.force)
    throwInput("{}: exists already; --force overwrites it", options.output);
}

// As the TOML will name the file: relative to its own folder.
fs::path relativeToOutput(const InitOptions& options) {
  const fs::path folder = fs::absolute(options.output).parent_path();
  const fs::path relative = fs::absolute(options.gltf).lexically_relative(folder);
  return relative.empty() ? fs::absolute(options.gltf) : relative;
}

// The suggested volume for the space that the cameras, or the one to be added, can reach.
Box3f boundsAround(const Scene& scene, const EmbreeScene& embree, const Vec3d& camera) {
  Scene with_camera = scene;
  if (scene.cameras.empty()) {
    with_camera.cameras.emplace_back();
    with_camera.cameras.back().position = toLocal(scene, camera);
  }
  const Box3d volume =
      suggestVolume(scene, findReachable(with_camera, embree), measureWallThickness(scene, embree));
  return {toLocal(scene, volume.min), toLocal(scene, volume.max)};
}

void printSummary(const Json& result) {
  std::vector<std::pair<std::string, std::string>> fields = {
      {"wrote", result["output"].get<std::string>()},
      {"camera", result["camera_added"].get<bool>() ? "added" : "those of the glTF"},
      {"light", result["light_added"].get<bool>() ? "a sun and a sky added" : "that of the glTF"}};
  std::string label = "next";
  for (const Json& command : result["next"]) {
    fields.emplace_back(label, command.get<std::string>());
    label.clear();
  }
  fmt::print("{}", formatFields(fields));
}

void runInit(const InitOptions& options, const Invocation& invocation) {
  checkInput(options);
  Scene scene = loadScene(options.gltf);
  for (const std::string& warning : scene.warnings) note(invocation, "warning: {}", warning);
  Vec3d camera = defaultCameraPosition(scene);
  const EmbreeScene embree(scene);
  if (scene.cameras.empty())
    if (const auto place = findCameraPosition(scene, embree, findReachable(scene, embree)))
      camera = toWorld(scene, *place);
  scene.bounds = boundsAround(scene, embree, camera);
  writeTextFile(options.output, describeSceneToml(scene, relativeToOutput(options), camera));

  const std::string stem = fs::path(options.output).stem().string();
  const Json result = {
      {"output", options.output},
      {"camera_added", scene.cameras.empty()},
      {"light_added", isUnlit(scene)},
      {"next",
       {fmt::format("probelab check {}", options.output),
        fmt::format("probelab reference {} -o {}_reference.exr --spp 64", options.output, stem),
        fmt::format("probelab evaluate {} --params rtxgi", options.output)}},
      {"provenance", toJson(makeProvenance(invocation, scene))}};
  reportResult(invocation, result, [&] { printSummary(result); });
}

}  // namespace

void addInitCommand(Program& program) {
  auto options = std::make_shared<InitOptions>();
  CLI::App& app = program.addCommand(
      "init", "a commented scene TOML for a glTF: bounds, a camera inside, sun and sky if unlit",
      "probelab init house.glb -o house.toml",
      [options](const Invocation& invocation) { runInit(*options, invocation); });
  app.add_option("FILE", options->gltf, "a .glb or .gltf file")->required();
  addOutputOption(app, options->output, "SCENE.toml", "the scene TOML", true);
  app.add_flag("--force", options->force, "overwrite the output where it exists")->group("Output");
}

}  // namespace probelab
