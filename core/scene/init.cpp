// SPDX-License-Identifier: Apache-2.0
#include "scene/init.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "warnings.h"

namespace probelab {
namespace {

constexpr double kEyeHeight = 0.4;  // of the box's height: 1.6 m in a 4 m hall

// A step of 1, 0.1, 0.01 ... that is a thousandth of the scene's size or less.
double roundingStep(const Scene& scene) {
  return std::pow(
      10.0, std::floor(std::log10(Vec3d(scene.bounds.extent()).x + Vec3d(scene.bounds.extent()).y +
                                  Vec3d(scene.bounds.extent()).z) -
                       3));
}

// The shortest decimal of multiple * step; TOML wants a point in a float.
std::string number(double multiple, double step) {
  // A quotient by a power of ten is the double closest to the decimal, a product need not be.
  const double value = step < 1 ? multiple / std::round(1 / step) : multiple * step;
  const std::string text = fmt::format("{}", value == 0 ? 0.0 : value);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

std::string vectorText(const Vec3d& v, double step, double (*round_to)(double)) {
  return fmt::format("[{}, {}, {}]", number(round_to(v.x / step), step),
                     number(round_to(v.y / step), step), number(round_to(v.z / step), step));
}

double roundNearest(double x) { return std::round(x); }
double roundDown(double x) { return std::floor(x); }
double roundUp(double x) { return std::ceil(x); }

// A TOML basic string.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\')
      result += {'\\', c};
    else if (byte < 0x20 || byte == 0x7f)
      result += fmt::format("\\u{:04X}", byte);
    else
      result += c;
  }
  return result + "\"";
}

Box3f roomOf(const Scene& scene) {
  const bool has_box = scene.geometry && !scene.geometry->box.empty();
  return has_box ? scene.geometry->box : scene.bounds;
}

std::string cameraText(const Scene& scene, const Vec3d& position, double step) {
  const Box3f room = roomOf(scene);
  const Vec3d min = toWorld(scene, room.min), max = toWorld(scene, room.max);
  const int axis = max.x - min.x >= max.z - min.z ? 0 : 2;
  const bool up = max[axis] - position[axis] >= position[axis] - min[axis];
  // At least a step away, whatever the rounding does.
  const double reach =
      std::max((up ? max[axis] - position[axis] : position[axis] - min[axis]), 4 * step);
  Vec3d target = position;
  target[axis] += up ? reach : -reach;
  return fmt::format(
      "\n# The glTF has no camera. Move it to where you want to look from.\n"
      "[[camera]]\nname = \"main\"\nposition = {}\ntarget = {}\nvertical_fov_deg = 60.0\n",
      vectorText(position, step, roundNearest), vectorText(target, step, roundNearest));
}

constexpr const char* kSunAndSky =
    "\n# The glTF has neither lights nor emission. A closed room stays dark under a sky: add "
    "point\n"
    "# or spot lights then (type = \"point\", position = [x, y, z], intensity in candela).\n"
    "[sky]                            # radiance; or image = \"sky.exr\" (equirectangular)\n"
    "radiance = [0.5, 0.6, 0.8]\n"
    "\n[[light]]\n"
    "name = \"sun\"\n"
    "type = \"directional\"             # directional | point | spot\n"
    "color = [1.0, 0.95, 0.9]\n"
    "intensity = 3.0                  # lux; candela for point and spot\n"
    "direction = [-0.5, -0.8, -0.3]   # the way the light travels\n";

constexpr const char* kStates =
    "\n# Lighting states, for fitting on some and judging on others:\n"
    "# [[state]]\n"
    "# name = \"evening\"\n"
    "# split = \"heldout\"              # train | heldout\n"
    "# lights = {{ {} = {{ intensity = 1.0 }} }}\n"
    "# sky_scale = 0.3\n";

}  // namespace

Vec3d defaultCameraPosition(const Scene& scene) {
  const Box3f room = roomOf(scene);
  Vec3d position = toWorld(scene, room.center());
  position.y = toWorld(scene, room.min).y + kEyeHeight * Vec3d(room.extent()).y;
  return position;
}

bool isUnlit(const Scene& scene) { return scene.lights.empty() && !sceneFeatures(scene).emission; }

std::string describeSceneToml(const Scene& scene, const std::filesystem::path& gltf,
                              const Vec3d& camera_position) {
  const double step = roundingStep(scene);
  std::string text = fmt::format(
      "# Scene description. Lengths in metres, angles in degrees, colours linear; +Y is up.\n"
      "gltf = {}   # relative to this file\n",
      quoted(gltf.generic_string()));
  text += "# time_s = 0.0                   # where in its animation\n";
  text += fmt::format(
      "\n# Where the probes answer. Enclose the walls, so that no bounce is lost; leave out what "
      "you\n"
      "# do not light with probes.\n[volume]\nmin = {}\nmax = {}\n",
      vectorText(toWorld(scene, scene.bounds.min), step, roundDown),
      vectorText(toWorld(scene, scene.bounds.max), step, roundUp));
  if (isUnlit(scene)) text += kSunAndSky;
  for (const Light& light : scene.lights)
    text += fmt::format("\n# the glTF's light: {}", printable(light.name));
  if (!scene.lights.empty()) text += "\n";
  if (scene.cameras.empty()) text += cameraText(scene, camera_position, step);
  for (const Camera& camera : scene.cameras)
    text += fmt::format("\n# the glTF's camera: {}", printable(camera.name));
  if (!scene.cameras.empty()) text += "\n";
  text +=
      "\n# Points in the space that counts, beside the cameras (every room that they cannot "
      "reach):\n"
      "# [receivers]\n# seeds = [[0.0, 1.6, 0.0]]\n";
  const std::string light = scene.lights.empty() ? "sun" : quoted(printable(scene.lights[0].name));
  return text + fmt::format(fmt::runtime(kStates), light);
}

}  // namespace probelab
