// SPDX-License-Identifier: Apache-2.0
#include "scene/load.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/hash.h"
#include "base/suggest.h"
#include "gltf_scene.h"
#include "scene_toml.h"
#include "sky_image.h"
#include "turn.h"
#include "warnings.h"

namespace probelab {
namespace fs = std::filesystem;
namespace {

constexpr double kSmallest = 1e-8;  // metres, the longest edge of the geometry's box

// The default bounds: the geometry's box, this share of its diagonal larger on every side.
constexpr double kGrowth = 0.01;

std::string lowerExtension(const fs::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return extension;
}

// "cornell", or "thin_wall/scene_01cm" where file and folder are called differently.
std::string nameOf(const fs::path& path) {
  const std::string stem = path.stem().string();
  const std::string folder =
      fs::absolute(path).lexically_normal().parent_path().filename().string();
  return folder.empty() || folder == stem ? stem : folder + "/" + stem;
}

Box3d grown(Box3d box) {
  const Vec3d margin(kGrowth * box.diagonal());
  box.min -= margin;
  box.max += margin;
  return box;
}

Box3f localBox(const Scene& scene, const Box3d& box) {
  Box3f local;
  local.min = toLocal(scene, box.min);
  local.max = toLocal(scene, box.max);
  return local;
}

void placeLights(const std::vector<PlacedLight>& lights, Scene& scene) {
  for (const PlacedLight& placed : lights) {
    Light light = placed.light;
    if (light.type != LightType::directional) light.position = toLocal(scene, placed.position);
    scene.base_lights.push_back(std::move(light));
    scene.light_colors.push_back(placed.color);
    scene.light_intensities.push_back(placed.intensity);
  }
  scene.lights = scene.base_lights;
}

void placeCameras(const std::vector<PlacedCamera>& cameras, Scene& scene) {
  for (const PlacedCamera& placed : cameras) {
    Camera camera = placed.camera;
    camera.position = toLocal(scene, placed.position);
    scene.cameras.push_back(std::move(camera));
  }
}

// A name in the TOML must not stand for something else in the glTF.
template <class List, class NameOf>
void checkNames(const SceneToml& toml, const List& ours, const List& files, const char* kind,
                NameOf name_of) {
  for (const auto& own : ours)
    for (const auto& other : files)
      if (name_of(own) == name_of(other))
        toml.fail(fmt::format("the {} '{}' exists in the glTF too; call it differently", kind,
                              printable(name_of(own))));
}

void checkStates(const SceneToml& toml, const Scene& scene) {
  std::vector<std::string> names;
  for (const Light& light : scene.lights) names.push_back(light.name);
  for (const StateEntry& entry : toml.states)
    for (const LightChange& change : entry.state.lights) {
      const auto it = std::find(names.begin(), names.end(), change.light);
      if (it == names.end())
        entry.fail(fmt::format("there is no light '{}'{}", printable(change.light),
                               suggestion(change.light, names)));
      const LightType type = scene.lights[it - names.begin()].type;
      if (change.position && type == LightType::directional)
        entry.fail(fmt::format("'{}' is directional and has no position", change.light));
      if (change.direction && type == LightType::point)
        entry.fail(fmt::format("'{}' is a point light and has no direction", change.light));
      if (change.color || change.intensity) {
        const std::size_t i = it - names.begin();
        const Vec3f result = change.color.value_or(scene.light_colors[i]) *
                             change.intensity.value_or(scene.light_intensities[i]);
        if (!isFinite(result)) entry.fail(fmt::format("'{}' is not finite", change.light));
      }
    }
}

void placeSeeds(const SceneToml& toml, const Box3d& bounds, Scene& scene) {
  for (const Vec3d& seed : toml.seeds) {
    if (!bounds.contains(seed))
      toml.fail_receivers(
          fmt::format("the seed ({}, {}, {}) lies outside the volume", seed.x, seed.y, seed.z));
    scene.receiver_seeds.push_back(toLocal(scene, seed));
  }
}

// `toml` is empty for a glTF that is loaded directly.
Scene assemble(const fs::path& path, SceneToml toml, GltfScene gltf,
               std::vector<std::string> hashes, Warnings& warnings) {
  const std::string file = path.string();
  const Box3d box = boxOf(gltf.geometry);
  if (box.empty() && !toml.volume)
    throwInput("{}: has no triangles; give its extent in the [volume] of a scene TOML", file);
  Scene scene;
  scene.path = file;
  scene.name = nameOf(path);
  const Box3d bounds = toml.volume ? *toml.volume : grown(box);
  scene.origin = box.empty() ? bounds.center() : box.center();
  scene.geometry = localGeometry(file, std::move(gltf.geometry), scene.origin, warnings);
  scene.materials = std::move(gltf.materials);
  scene.textures = std::move(gltf.textures);
  checkNames(toml, toml.lights, gltf.lights, "light",
             [](const PlacedLight& l) { return l.light.name; });
  checkNames(toml, toml.cameras, gltf.cameras, "camera",
             [](const PlacedCamera& c) { return c.camera.name; });
  placeLights(gltf.lights, scene);
  placeLights(toml.lights, scene);
  placeCameras(toml.cameras, scene);
  placeCameras(gltf.cameras, scene);
  scene.bounds = localBox(scene, bounds);
  if (!(minComponent(scene.bounds.extent()) > 0))
    throwInput("{}: the volume is too thin to be told from a plane in single precision", file);
  if (!box.empty() && maxComponent(box.extent()) < kSmallest)
    throwInput("{}: is {:.3g} m large; below {:g} m areas of triangles are lost in single precision: "
               "scale it up",
               file, maxComponent(box.extent()), kSmallest);
  placeSeeds(toml, bounds, scene);
  scene.sky = std::move(toml.sky);
  scene.flip = toml.flip;
  checkStates(toml, scene);
  for (StateEntry& entry : toml.states) scene.states.push_back(std::move(entry.state));
  if (scene.states.empty()) scene.states.emplace_back().name = "default";
  std::string all_hashes;
  for (const std::string& hash : hashes) all_hashes += hash;
  scene.content_hash = contentHash(all_hashes);
  scene.warnings = warnings.take();
  return withState(scene, scene.states.front().name);
}

Scene loadToml(const fs::path& path) {
  std::vector<std::string> hashes;
  Warnings warnings;
  SceneToml toml = readSceneToml(path, hashes);
  if (toml.gltf.empty() && !toml.volume)
    throwInput("{}: names no gltf, so it needs a [volume]", path.string());
  if (!toml.sky_image.empty()) readSkyImage(toml.sky_image, toml.sky, hashes);
  GltfScene gltf;
  if (!toml.gltf.empty()) gltf = loadGltf(toml.gltf, toml.time_s, warnings, hashes);
  if (toml.turn_rad != 0) turnScene(toml, gltf);
  return assemble(path, std::move(toml), std::move(gltf), std::move(hashes), warnings);
}

}  // namespace

Scene loadScene(const fs::path& path) {
  const std::string extension = lowerExtension(path);
  if (extension == ".toml") return loadToml(path);
  if (extension != ".gltf" && extension != ".glb")
    throwInput("{}: is no scene; a .gltf, .glb or scene .toml is needed", path.string());
  std::vector<std::string> hashes;
  Warnings warnings;
  GltfScene gltf = loadGltf(path, 0, warnings, hashes);
  return assemble(path, {}, std::move(gltf), std::move(hashes), warnings);
}

}  // namespace probelab
