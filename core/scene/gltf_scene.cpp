// SPDX-License-Identifier: Apache-2.0
#include "gltf_scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "base/error.h"

namespace probelab {
namespace {

// The index into KHR_lights_punctual's lights, -1: the node carries none.
int lightOf(const tinygltf::Node& node) {
  const auto it = node.extensions.find("KHR_lights_punctual");
  return it == node.extensions.end() ? -1 : it->second.Get("light").GetNumberAsInt();
}

Vec3d axisOf(const GltfFile& gltf, const PlacedNode& placed, const Vec3d& axis) {
  const Vec3d direction = transformVector(placed.to_world, axis);
  const double size = length(direction);
  if (!(size > 0) || !std::isfinite(size))
    throwInput("{}: {}: its transform gives no direction", gltf.path, nodeName(gltf, placed.node));
  return direction / size;
}

Vec3d positionOf(const GltfFile& gltf, const PlacedNode& placed) {
  const Vec3d p = transformPoint(placed.to_world, {});
  if (!(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= kMaxCoordinate))
    throwInput("{}: {}: lies beyond {} m", gltf.path, nodeName(gltf, placed.node), kMaxCoordinate);
  return p;
}

// The node's name is what people see in a modeller.
std::string nameFor(const std::string& node_name, const std::string& own, const char* kind,
                    std::size_t index) {
  if (!node_name.empty()) return node_name;
  return own.empty() ? fmt::format("{} {}", kind, index) : own;
}

// "lamp", "lamp#2", "lamp#3" ...
class UniqueNames {
 public:
  std::string take(const std::string& name) {
    std::string candidate = name;
    while (count_.contains(candidate)) candidate = fmt::format("{}#{}", name, ++count_[name]);
    count_[candidate] = 1;
    return candidate;
  }

 private:
  std::map<std::string, int> count_;
};

void convertSpot(const GltfFile& gltf, const tinygltf::Light& source, const std::string& element,
                 Light& light) {
  const double inner = source.spot.innerConeAngle, outer = source.spot.outerConeAngle;
  // Exporters write pi/2 in single precision, which is a little more.
  if (!(inner >= 0 && inner <= outer && outer > 0 && outer <= std::numbers::pi / 2 + 1e-6))
    throwInput("{}: {}: its cone angles {} and {} must be 0 <= inner <= outer <= pi/2", gltf.path,
               element, inner, outer);
  light.cos_inner = static_cast<float>(std::cos(inner));
  light.cos_outer = static_cast<float>(std::cos(outer));
}

PlacedLight convertLight(const GltfFile& gltf, const PlacedNode& placed, int index) {
  const tinygltf::Light& source = gltf.model.lights[index];
  const std::string element = elementName("light", index, source.name);
  PlacedLight out;
  Light& light = out.light;
  light.name = nameFor(gltf.model.nodes[placed.node].name, source.name, "light", index);
  if (source.type == "directional")
    light.type = LightType::directional;
  else if (source.type == "point")
    light.type = LightType::point;
  else if (source.type == "spot")
    light.type = LightType::spot;
  else
    throwInput("{}: {}: its type '{}' is none of directional, point, spot", gltf.path, element,
               printable(source.type));
  for (int c = 0; c < 3; ++c)
    out.color[c] = source.color.size() == 3 ? static_cast<float>(source.color[c]) : 1.0f;
  out.intensity = static_cast<float>(source.intensity);
  light.intensity = out.color * out.intensity;
  if (!isFinite(light.intensity) || minComponent(out.color) < 0 || !(out.intensity >= 0))
    throwInput("{}: {}: its colour and intensity must be finite and not negative", gltf.path,
               element);
  // tinygltf's 0 stands for a missing range, which is unlimited.
  if (!(source.range >= 0) || !std::isfinite(static_cast<float>(source.range)))
    throwInput("{}: {}: its range is {}, must be positive", gltf.path, element, source.range);
  if (source.range > 0) light.range = static_cast<float>(source.range);
  if (light.type == LightType::spot) convertSpot(gltf, source, element, light);
  light.direction = Vec3f(axisOf(gltf, placed, {0, 0, -1}));
  out.position = positionOf(gltf, placed);
  return out;
}

PlacedCamera convertCamera(const GltfFile& gltf, const PlacedNode& placed, int index) {
  const tinygltf::Camera& source = gltf.model.cameras[index];
  const double fov = source.perspective.yfov;
  if (!(fov > 0 && fov < std::numbers::pi))
    throwInput("{}: {}: yfov is {}, must be within 0 and pi", gltf.path,
               elementName("camera", index, source.name), fov);
  PlacedCamera out;
  out.camera.name = nameFor(gltf.model.nodes[placed.node].name, source.name, "camera", index);
  const Vec3d forward = axisOf(gltf, placed, {0, 0, -1});
  out.camera.forward = Vec3f(forward);
  out.camera.up = Vec3f(cameraUp(forward, axisOf(gltf, placed, {0, 1, 0})));
  out.camera.vertical_fov_rad = static_cast<float>(fov);
  out.position = positionOf(gltf, placed);
  return out;
}

}  // namespace

Vec3d cameraUp(const Vec3d& forward, const Vec3d& up) {
  for (const Vec3d& candidate : {up, Vec3d(0, 1, 0), Vec3d(0, 0, -1)}) {
    const Vec3d across = candidate - forward * dot(candidate, forward);
    if (length(across) > 1e-6 * length(candidate)) return normalize(across);
  }
  return {1, 0, 0};
}

GltfScene loadGltf(const std::filesystem::path& path, double time_s, Warnings& warnings,
                   std::vector<std::string>& hashes) {
  const GltfFile gltf = readGltf(path, warnings);
  hashes.insert(hashes.end(), gltf.hashes.begin(), gltf.hashes.end());
  const std::vector<PlacedNode> nodes = placeNodes(gltf, time_s, warnings);
  GltfMaterials materials(gltf, warnings);
  GltfScene scene;
  scene.geometry = buildGeometry(gltf, nodes, materials, warnings);
  scene.materials = std::move(materials.materials());
  scene.textures = std::move(materials.textures());
  UniqueNames light_names, camera_names;
  for (const PlacedNode& placed : nodes) {
    const tinygltf::Node& node = gltf.model.nodes[placed.node];
    if (const int light = lightOf(node); light >= 0) {
      scene.lights.push_back(convertLight(gltf, placed, light));
      scene.lights.back().light.name = light_names.take(scene.lights.back().light.name);
    }
    if (node.camera < 0) continue;
    const tinygltf::Camera& camera = gltf.model.cameras[node.camera];
    if (camera.type == "perspective") {
      scene.cameras.push_back(convertCamera(gltf, placed, node.camera));
      scene.cameras.back().camera.name = camera_names.take(scene.cameras.back().camera.name);
    } else {
      warnings.add("{}: {}: is not a perspective camera and is left out", gltf.path,
                   elementName("camera", node.camera, camera.name));
    }
  }
  return scene;
}

}  // namespace probelab
