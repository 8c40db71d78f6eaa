// SPDX-License-Identifier: GPL-3.0-or-later
// The lights that are drawn from a scene: where they stand, what they are, and their truth against
// path tracing.
#include "placement/lighting.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "path_truth.h"
#include "places.h"

namespace probelab::test {
namespace {

std::vector<Lighting> drawn(const Place& place, const LightingPlan& plan) {
  return trainingLighting(place.scene, place.embree, place.reachability, plan);
}

// A corner in the sun.
Scene sunRoom() {
  SceneBuilder b;
  const uint32_t grey = b.material(Vec3f(0.6f));
  b.quad({0, 0, 0}, {0, 0, 4}, {4, 0, 4}, {4, 0, 0}, grey);
  b.quad({0, 0, 0}, {0, 3, 0}, {0, 3, 4}, {0, 0, 4}, grey);
  b.sun({0.3f, -0.8f, -0.4f}, Vec3f(5));
  b.camera({2, 1.5f, 3}, {2, 1, 0});
  b.scene().sky.radiance = Vec3f(0.3f);
  b.scene().bounds = {{-0.1f, -0.1f, -0.1f}, {4.1f, 3.1f, 4.1f}};
  return b.finish();
}

TEST(Lighting, LampsOfAStateStandApartInFreeSpace) {
  const Place place(twoRooms());
  const std::vector<Lighting> all =
      drawn(place, {.split = Split::heldout, .generated = 24, .lamps_each = 8, .seed = 3});
  ASSERT_EQ(all.size(), 24u);  // the scene has no held-out state
  std::vector<Vec3f> points;  // of the states that share them
  std::size_t all_west = 0;
  double apart = 0;  // least distance of two lamps in one room and state
  for (const Lighting& state : all) {
    ASSERT_EQ(state.name, "lamp");
    if (&state - all.data() < 12) {
      EXPECT_EQ(state.lights.size(), 1u);
      continue;
    }
    ASSERT_EQ(state.lights.size(), 8u);
    std::size_t west = 0;
    double least = 9;
    for (const LightData& a : state.lights) {
      EXPECT_FALSE(std::abs(a.position.x) < 0.05f) << "in the wall";
      west += a.position.x < 0;
      points.push_back(a.position);
      for (const LightData& b : state.lights)
        if (&a != &b && a.position.x * b.position.x > 0)
          least = std::min(least, static_cast<double>(length(a.position - b.position)));
    }
    EXPECT_GE(west, 1u);
    EXPECT_LE(west, 7u);
    all_west += west;
    apart += least / 12;
  }
  EXPECT_NEAR(static_cast<double>(all_west), 48, 8);  // the rooms are equal
  double nearest = 0;  // of all lamps, whichever the state
  for (const Vec3f& a : points) {
    double least = 9;
    for (const Vec3f& b : points)
      if (&a != &b) least = std::min(least, static_cast<double>(length(a - b)));
    nearest += least / static_cast<double>(points.size());
  }
  EXPECT_GT(nearest, 0.3);  // 96 lamps in 54 m^3: as far apart as they fit is near to 0.9 m
  EXPECT_GT(apart, 1.2 * nearest);
}

TEST(Lighting, KindsAreTheScenesAlsoForASplitWithoutStates) {
  const Place place(sunRoom());
  const std::vector<Lighting> all =
      drawn(place, {.split = Split::heldout, .generated = 9, .lamps_each = 1, .seed = 3});
  ASSERT_EQ(all.size(), 9u);
  EXPECT_EQ(all.front().name, "sky");
  for (std::size_t i = 1; i < all.size(); ++i) {
    EXPECT_EQ(all[i].name, "sun");
    EXPECT_LT(all[i].lights.at(0).direction.y, 0);
    EXPECT_GT(all[i].sky_scale, 0);
  }
}

TEST(Lighting, TheScenesOwnStatesComeBeforeGeneratedOnes) {
  Scene scene = twoRooms();
  scene.states.assign(100, {});
  for (std::size_t i = 0; i < scene.states.size(); ++i)
    scene.states[i].name = "state " + std::to_string(i);
  const LightingPlan plan = {.generated = 60, .lamps_each = 8, .seed = 3};
  const std::vector<Lighting> all = drawn(Place(scene), plan);
  ASSERT_EQ(all.size(), kMostStates);
  EXPECT_EQ(std::ranges::count_if(all, [](const Lighting& l) { return l.own; }), 100);
  scene.states.assign(kMostStates + 1, {"one", Split::train, {}, 1.0f});
  EXPECT_THROW(drawn(Place(scene), plan), InputError);
}

TEST(Lighting, TruthOfADrawnStateIsWhatPathsFind) {
  Place place(twoRooms());
  Training training(place.scene, place.embree, place.reachability,
                    {.receivers = 500, .lights = 2, .split = Split::heldout, .seed = 3,
                     .receiver_rays = 512, .lamps_each = 8});
  const Training::Data& data = training.data();
  ASSERT_EQ(data.stateCount(), 2u);
  Scene lit = place.scene;
  lit.lights.clear();
  for (const LightData& light : data.patches->lighting()[1].lights) {
    Light lamp;
    lamp.type = LightType::point;
    lamp.position = light.position, lamp.intensity = light.intensity;
    lit.lights.push_back(lamp);
  }
  const TruthAgainstPaths found = againstPaths(data, lit, EmbreeScene(lit), 1);
  EXPECT_NEAR(found.ratio, 1, 0.01);
  EXPECT_LT(found.nrmse, 0.05);
}

}  // namespace
}  // namespace probelab::test
