// SPDX-License-Identifier: GPL-3.0-or-later
// Small scenes with everything that a strategy asks for.
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "placement/free_space.h"
#include "placement/strategy.h"
#include "placement/training.h"
#include "scene_builders.h"

namespace probelab::test {

// A scene ready for placing; `training` is small, so that strategies that score stay fast.
struct Place {
  explicit Place(Scene s)
      : scene(std::move(s)),
        embree(scene),
        reachability(findReachable(scene, embree)),
        training(scene, embree, reachability, TrainingSettings{128, 1, Split::train, 7}) {}
  PlacementInput input(int probes, uint64_t seed = 1, OptionValues options = {}) {
    return {scene, embree, reachability, params, training, probes, seed, std::move(options)};
  }

  Scene scene;
  EmbreeScene embree;
  Reachability reachability;
  Params params = loadParams("probelab");
  Training training;
};

inline Vec3f scaled(float scale, float x, float y, float z) {
  return {scale * x, scale * y, scale * z};
}

// 4 x 3 x 5 m with walls of 0.2 m, a lamp and a solid pillar from floor to ceiling. The bounds end
// in the middle of the walls.
inline Scene pillarRoom(float scale = 1) {
  SceneBuilder b;
  const uint32_t grey = b.material(Vec3f(0.6f));
  b.shell(scaled(scale, 0, 0, 0), scaled(scale, 4, 3, 5), 0.2f * scale, grey, grey);
  b.box(scaled(scale, 1.5f, 0, 2), scaled(scale, 2.5f, 3, 3), grey, false);
  b.pointLight(scaled(scale, 1, 2, 1), Vec3f(10 * scale * scale));
  b.camera(scaled(scale, 1, 1.5f, 1), scaled(scale, 3, 1, 4));
  b.scene().bounds = {scaled(scale, -0.1f, -0.1f, -0.1f), scaled(scale, 4.1f, 3.1f, 5.1f)};
  return b.finish();
}

// Two rooms of 3 x 3 x 3 m, x from -3.05 and to 3.05, with 10 cm of wall between them; a camera in
// each.
inline Scene twoRooms() {
  SceneBuilder b;
  const uint32_t grey = b.material(Vec3f(0.6f));
  b.box({-3.05f, 0, 0}, {-0.05f, 3, 3}, grey, true);
  b.box({0.05f, 0, 0}, {3.05f, 3, 3}, grey, true);
  b.box({-3.25f, -0.2f, -0.2f}, {3.25f, 3.2f, 3.2f}, grey, false);
  b.pointLight({-1.5f, 2, 1.5f}, Vec3f(10));
  b.camera({-1, 1, 1}, {-2, 1, 2});
  b.camera({1, 1, 1}, {2, 1, 2});
  return b.finish();
}

// An L of two corridors 2 m wide; the middle of its box is in the wall.
inline Scene corridor() {
  SceneBuilder b;
  const uint32_t grey = b.material(Vec3f(0.6f));
  const float h = 2.5f;
  b.quad({0, 0, 0}, {0, 0, 2}, {2, 0, 2}, {2, 0, 0}, grey);
  b.quad({2, 0, 0}, {2, 0, 2}, {10, 0, 2}, {10, 0, 0}, grey);
  b.quad({0, 0, 2}, {0, 0, 10}, {2, 0, 10}, {2, 0, 2}, grey);
  b.quad({0, h, 0}, {2, h, 0}, {2, h, 2}, {0, h, 2}, grey);
  b.quad({2, h, 0}, {10, h, 0}, {10, h, 2}, {2, h, 2}, grey);
  b.quad({0, h, 2}, {2, h, 2}, {2, h, 10}, {0, h, 10}, grey);
  const auto wall = [&](float x0, float z0, float x1, float z1) {
    b.quad({x0, 0, z0}, {x1, 0, z1}, {x1, h, z1}, {x0, h, z0}, grey);
  };
  wall(0, 0, 10, 0), wall(10, 0, 10, 2), wall(10, 2, 2, 2);
  wall(2, 2, 2, 10), wall(2, 10, 0, 10), wall(0, 10, 0, 0);
  b.pointLight({1, 2, 1}, Vec3f(20));
  b.camera({1, 1.5f, 1}, {5, 1, 1});
  return b.finish();
}

// Ground without an underside, half a box without a lid on it, two boxes that share an edge's
// worth of space, and a sheet seen from both sides, under the sky.
inline Scene openYard() {
  SceneBuilder b;
  const uint32_t grey = b.material(Vec3f(0.6f));
  const uint32_t sheet = b.material(Vec3f(0.5f), Vec3f(), true);
  b.quad({-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4}, grey);
  b.box({-3, 0, -3}, {-1, 1.5f, -1}, grey, false);
  b.box({-2, 0, -2}, {0, 1, 0}, grey, false);
  b.geometry().triangles.resize(b.geometry().triangles.size() - 2);
  b.quad({1, 0, 1}, {3, 0, 1}, {3, 2, 1}, {1, 2, 1}, sheet);
  b.scene().sky.radiance = Vec3f(1);
  b.scene().bounds = {{-4, -0.5f, -4}, {4, 3, 4}};
  b.camera({3, 1.5f, -3}, {0, 0, 0});
  return b.finish();
}

// Nothing but sky in a box.
inline Scene emptySpace() {
  SceneBuilder b;
  b.scene().sky.radiance = Vec3f(1);
  b.scene().bounds = {{-1, -1, -1}, {1, 1, 1}};
  return b.finish();
}

}  // namespace probelab::test
