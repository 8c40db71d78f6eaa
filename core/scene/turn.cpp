// SPDX-License-Identifier: Apache-2.0
#include "turn.h"

#include <cmath>

namespace probelab {
namespace {

struct Turn {
  double cosine, sine;
  Vec3d operator()(const Vec3d& v) const {
    return {cosine * v.x + sine * v.z, v.y, cosine * v.z - sine * v.x};
  }
  Vec3f operator()(const Vec3f& v) const { return Vec3f((*this)(Vec3d(v))); }
};

void turnLights(const Turn& turn, std::vector<PlacedLight>& lights) {
  for (PlacedLight& placed : lights) {
    placed.position = turn(placed.position);
    placed.light.direction = turn(placed.light.direction);
  }
}

void turnCameras(const Turn& turn, std::vector<PlacedCamera>& cameras) {
  for (PlacedCamera& placed : cameras) {
    placed.position = turn(placed.position);
    placed.camera.forward = turn(placed.camera.forward);
    placed.camera.up = turn(placed.camera.up);
  }
}

}  // namespace

void turnScene(SceneToml& toml, GltfScene& gltf) {
  const Turn turn{std::cos(toml.turn_rad), std::sin(toml.turn_rad)};
  for (Vec3d& p : gltf.geometry.positions) p = turn(p);
  for (Vec3f& n : gltf.geometry.normals) n = turn(n);
  turnLights(turn, gltf.lights);
  turnLights(turn, toml.lights);
  turnCameras(turn, gltf.cameras);
  turnCameras(turn, toml.cameras);
  for (Vec3d& seed : toml.seeds) seed = turn(seed);
  for (StateEntry& entry : toml.states)
    for (LightChange& change : entry.state.lights) {
      if (change.position) change.position = turn(*change.position);
      if (change.direction) change.direction = turn(*change.direction);
    }
  toml.sky.linear = turn(toml.sky.linear);
}

}  // namespace probelab
