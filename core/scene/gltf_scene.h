// SPDX-License-Identifier: Apache-2.0
// Everything a glTF file says about a scene, in world coordinates.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "gltf_geometry.h"
#include "scene/scene.h"

namespace probelab {

// A light with the parts that a lighting state may change; its position is in world coordinates and
// `light.position` is not set yet. `light.intensity` = color * intensity.
struct PlacedLight {
  Light light;
  Vec3d position;
  Vec3f color{1.0f};
  float intensity = 1.0f;
};

// As above: `camera.position` is not set yet.
struct PlacedCamera {
  Camera camera;
  Vec3d position;
};

struct GltfScene {
  WorldGeometry geometry;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<PlacedLight> lights;    // names are unique; a repeated one gets "#2" and so on
  std::vector<PlacedCamera> cameras;  // likewise
};

// `hashes`: of every file that was read are appended. Throws InputError.
GltfScene loadGltf(const std::filesystem::path& path, double time_s, Warnings& warnings,
                   std::vector<std::string>& hashes);

// Orthogonal to `forward` (unit) and as close to `up` as that allows; any if they are parallel.
Vec3d cameraUp(const Vec3d& forward, const Vec3d& up);

}  // namespace probelab
