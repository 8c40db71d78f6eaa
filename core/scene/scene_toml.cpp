// SPDX-License-Identifier: Apache-2.0
#include "scene_toml.h"

#include <cmath>
#include <numbers>
#include <set>

#include "base/files.h"
#include "base/hash.h"
#include "toml_reader.h"
#include "warnings.h"

namespace probelab {
namespace fs = std::filesystem;
namespace {

constexpr NumberRange kCoordinate{-kMaxCoordinate, kMaxCoordinate};
constexpr double kRadians = std::numbers::pi / 180;

std::string requiredName(TableReader& reader, const char* kind) {
  const std::string name = reader.required("name", reader.text("name"));
  reader.rename(fmt::format("[[{}]] '{}'", kind, printable(name)));
  return name;
}

Vec3d directionOf(const TableReader& reader, const Vec3d& direction) {
  const double size = length(direction);
  if (!(size > 0)) reader.fail("direction", "direction is zero");
  return direction / size;
}

fs::path existingFile(const TableReader& reader, const char* key, const fs::path& folder) {
  const fs::path path = folder / reader.text(key).value();
  std::error_code ec;
  if (!fs::is_regular_file(path, ec))
    reader.fail(key, "{} = '{}': no such file", key, path.string());
  return path;
}

void readSky(const TableReader& reader, const fs::path& folder, SceneToml& scene) {
  reader.allowOnly({"radiance", "linear", "image"});
  if (reader.has("image") && (reader.has("radiance") || reader.has("linear")))
    reader.fail("image", "has an image beside radiance or linear; give one of them");
  if (reader.has("image")) scene.sky_image = existingFile(reader, "image", folder);
  scene.sky.radiance = Vec3f(reader.vector("radiance", kNotNegative).value_or(Vec3d()));
  const Vec3d linear = reader.vector("linear").value_or(Vec3d());
  if (length(linear) > 1)
    reader.fail("linear",
                "the length of linear is {}, must be 1 or less (else radiance is negative)",
                length(linear));
  scene.sky.linear = Vec3f(linear);
}

void readSpot(const TableReader& reader, Light& light) {
  const double inner = reader.number("inner_cone_deg", {0, 90}).value_or(0);
  const double outer = reader.number("outer_cone_deg", {0, 90}).value_or(45);
  if (!(inner <= outer && outer > 0))
    reader.fail("outer_cone_deg", "inner_cone_deg {} must not exceed outer_cone_deg {}", inner,
                outer);
  light.cos_inner = static_cast<float>(std::cos(inner * kRadians));
  light.cos_outer = static_cast<float>(std::cos(outer * kRadians));
}

PlacedLight readLight(TableReader reader) {
  PlacedLight out;
  Light& light = out.light;
  light.name = requiredName(reader, "light");
  reader.allowOnly({"name", "type", "color", "intensity", "position", "direction", "range_m",
                    "inner_cone_deg", "outer_cone_deg"});
  light.type = static_cast<LightType>(
      reader.required("type", reader.choice("type", {"directional", "point", "spot"})));
  out.color = Vec3f(reader.vector("color", kNotNegative).value_or(Vec3d(1.0)));
  out.intensity =
      static_cast<float>(reader.required("intensity", reader.number("intensity", kNotNegative)));
  light.intensity = out.color * out.intensity;
  if (!isFinite(light.intensity)) reader.fail("intensity", "color x intensity is not finite");
  const bool directional = light.type == LightType::directional;
  const bool spot = light.type == LightType::spot;
  for (const char* key : {"position", "range_m"})
    if (directional && reader.has(key)) reader.fail(key, "a directional light has no {}", key);
  for (const char* key : {"inner_cone_deg", "outer_cone_deg"})
    if (!spot && reader.has(key)) reader.fail(key, "only a spot light has {}", key);
  if (light.type == LightType::point && reader.has("direction"))
    reader.fail("direction", "a point light has no direction");
  if (!directional)
    out.position = reader.required("position", reader.vector("position", kCoordinate));
  if (directional || spot)
    light.direction =
        Vec3f(directionOf(reader, reader.required("direction", reader.vector("direction"))));
  if (spot) readSpot(reader, light);
  if (const auto range = reader.number("range_m")) {
    if (!(*range > 0)) reader.fail("range_m", "range_m is {}, must be positive", *range);
    light.range = static_cast<float>(*range);
  }
  return out;
}

PlacedCamera readCamera(TableReader reader) {
  PlacedCamera out;
  out.camera.name = requiredName(reader, "camera");
  reader.allowOnly({"name", "position", "target", "vertical_fov_deg"});
  out.position = reader.required("position", reader.vector("position", kCoordinate));
  const Vec3d target = reader.required("target", reader.vector("target", kCoordinate));
  const double distance = length(target - out.position);
  if (!(distance > 0)) reader.fail("target", "target is the camera's own position");
  const Vec3d forward = (target - out.position) / distance;
  out.camera.forward = Vec3f(forward);
  out.camera.up = Vec3f(cameraUp(forward, {0, 1, 0}));
  const double fov = reader.number("vertical_fov_deg").value_or(45);
  if (!(fov > 0 && fov < 180))
    reader.fail("vertical_fov_deg", "vertical_fov_deg is {}, must be within 0 and 180", fov);
  out.camera.vertical_fov_rad = static_cast<float>(fov * kRadians);
  return out;
}

Box3d readVolume(const TableReader& reader) {
  reader.allowOnly({"min", "max"});
  Box3d box;
  box.min = reader.required("min", reader.vector("min", kCoordinate));
  box.max = reader.required("max", reader.vector("max", kCoordinate));
  for (int axis = 0; axis < 3; ++axis)
    if (!(box.min[axis] < box.max[axis]))
      reader.fail("max", "the volume has no size along {}: min {}, max {}", "xyz"[axis],
                  box.min[axis], box.max[axis]);
  return box;
}

LightChange readLightChange(const std::string& light, const TableReader& reader) {
  reader.allowOnly({"color", "intensity", "position", "direction"});
  LightChange change;
  change.light = light;
  if (const auto color = reader.vector("color", kNotNegative)) change.color = Vec3f(*color);
  if (const auto position = reader.vector("position", kCoordinate))
    change.position = Vec3f(*position);
  if (const auto direction = reader.vector("direction"))
    change.direction = Vec3f(directionOf(reader, *direction));
  if (const auto intensity = reader.number("intensity", kNotNegative))
    change.intensity = static_cast<float>(*intensity);
  return change;
}

// The reader refers to the parsed file, which is gone later: the place is fixed now.
TomlFailure failureAt(const TableReader& reader, const char* key) {
  std::string prefix;
  try {
    reader.fail(key, "");
  } catch (const InputError& e) {
    prefix = e.what();
  }
  return [prefix](const std::string& what) { throwInput("{}{}", prefix, what); };
}

StateEntry readState(TableReader reader) {
  StateEntry entry;
  entry.state.name = requiredName(reader, "state");
  reader.allowOnly({"name", "split", "lights", "sky_scale"});
  entry.state.split = static_cast<Split>(reader.choice("split", {"train", "heldout"}).value_or(0));
  entry.state.sky_scale = static_cast<float>(reader.number("sky_scale", kNotNegative).value_or(1));
  const std::string element = fmt::format("[[state]] '{}', lights", printable(entry.state.name));
  if (const auto lights = reader.table("lights", element))
    for (const auto& [light, changes] : lights->members())
      entry.state.lights.push_back(readLightChange(light, changes));
  entry.fail = failureAt(reader, "lights");
  return entry;
}

template <class List, class NameOf>
void checkUnique(const List& list, const std::vector<TableReader>& readers, NameOf name_of) {
  std::set<std::string> seen;
  for (std::size_t i = 0; i < list.size(); ++i)
    if (!seen.insert(name_of(list[i])).second)
      readers[i].fail("name", "the name '{}' is used twice", printable(name_of(list[i])));
}

void readLists(const TableReader& root, SceneToml& scene) {
  const auto lights = root.tables("light"), cameras = root.tables("camera"),
             states = root.tables("state");
  for (const TableReader& reader : lights) scene.lights.push_back(readLight(reader));
  for (const TableReader& reader : cameras) scene.cameras.push_back(readCamera(reader));
  for (const TableReader& reader : states) scene.states.push_back(readState(reader));
  checkUnique(scene.lights, lights, [](const PlacedLight& l) { return l.light.name; });
  checkUnique(scene.cameras, cameras, [](const PlacedCamera& c) { return c.camera.name; });
  checkUnique(scene.states, states, [](const StateEntry& s) { return s.state.name; });
}

}  // namespace

SceneToml readSceneToml(const fs::path& path, std::vector<std::string>& hashes) {
  const std::string text = readTextFile(path);
  hashes.push_back(contentHash(text));
  const toml::table table = parseToml(text, path.string());
  const TableReader root(table, path.string(), "");
  root.allowOnly({"gltf", "time_s", "turn_deg", "sky", "light", "camera", "volume", "receivers",
                  "flip", "state"});
  SceneToml scene;
  scene.fail = failureAt(root, "gltf");
  scene.fail_receivers = failureAt(root, "receivers");
  if (root.has("gltf")) scene.gltf = existingFile(root, "gltf", path.parent_path());
  scene.time_s = root.number("time_s").value_or(0);
  if (const auto turn = root.number("turn_deg", {-360, 360})) scene.turn_rad = *turn * kRadians;
  if (const auto sky = root.table("sky", "[sky]")) readSky(*sky, path.parent_path(), scene);
  readLists(root, scene);
  if (const auto volume = root.table("volume", "[volume]")) scene.volume = readVolume(*volume);
  if (root.has("turn_deg") && (scene.volume || !scene.sky_image.empty()))
    root.fail("turn_deg", "turn_deg cannot turn a {}",
              scene.volume ? "[volume], which is a box along the axes" : "sky image");
  if (const auto receivers = root.table("receivers", "[receivers]")) {
    receivers->allowOnly({"seeds"});
    scene.seeds = receivers->vectors("seeds", kCoordinate);
  }
  if (const auto flip = root.table("flip", "[flip]")) {
    flip->allowOnly({"start", "stop"});
    scene.flip = FlipExposures{
        static_cast<float>(flip->required("start", flip->number("start", {-100, 100}))),
        static_cast<float>(flip->required("stop", flip->number("stop", {-100, 100})))};
    if (!(scene.flip->start < scene.flip->stop)) flip->fail("stop", "start must be less than stop");
  }
  return scene;
}

}  // namespace probelab
