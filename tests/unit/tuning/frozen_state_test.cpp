// SPDX-License-Identifier: GPL-3.0-or-later
#include "tuning/frozen_state.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "tuning_helpers.h"

namespace probelab {
namespace {

using test::RoomScene;

struct FrozenStateTest : testing::Test {
  RoomScene room;
  Params params = loadParams("rtxgi");
  FieldSnapshot field = test::roomSnapshot(room, test::roomLattice(room), params);
  Receivers receivers = [] {
    Receivers r;
    r.scene_path = "rooms.gltf", r.state = "day", r.samples = 16;
    return r;
  }();

  void add(const Vec3f& p, const Vec3f& n, float a, float b, double area, Split split) {
    Receiver r{p, n, -n, area};
    r.region = 0, r.split = split, r.a = Vec3f(a), r.b = Vec3f(b);
    receivers.points.push_back(r);
  }
  FrozenState freeze(std::vector<Vec3f> cameras = {}, Split split = Split::train) {
    return freezeState(field, receivers, split, cameras, room.embree);
  }
  std::string refusal() {
    try {
      freeze();
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }
};

TEST_F(FrozenStateTest, SumsAndFlagsAreThoseOfTheSplitByHand) {
  add(Vec3f(1, 0, 1), Vec3f(0, 1, 0), 2, 4, 3, Split::train);
  add(Vec3f(1, 0, 2), Vec3f(0, 1, 0), 0.1f, 0.3f, 1, Split::train);
  add(Vec3f(1, 0, 2), Vec3f(0, 1, 0), 50, 50, 1, Split::heldout);
  const FrozenState state = freeze();
  ASSERT_EQ(state.points.size(), 2u);
  EXPECT_NEAR(state.points[0].truth, 3, 1e-6);
  EXPECT_NEAR(state.mean, 0.75 * 3 + 0.25 * 0.2, 1e-6);
  EXPECT_NEAR(state.power, 0.75 * 8 + 0.25 * 0.03, 1e-6);
  EXPECT_NEAR(state.noise, (0.75 * 1 + 0.25 * 0.01) / state.power, 1e-6);
  EXPECT_FALSE(state.points[0].dark);
  EXPECT_TRUE(state.points[1].dark);
  // Two neighbours: both variances are the mean of 1 and 0.01.
  EXPECT_NEAR(state.points[0].sigma, std::sqrt(0.505), 1e-6);
  EXPECT_EQ(state.state, "day");
}

TEST_F(FrozenStateTest, AReceiverIsSeenByEveryCameraInFrontOfItAndNotHidden) {
  add(Vec3f(1, 0, 1), Vec3f(0, 1, 0), 2, 2, 1, Split::train);
  const Vec3f seen(0.5f, 2, 2), hidden(3.5f, 1, 0.5f), above(1, 2, 1);
  const FrozenState state = freeze({seen, hidden, above, Vec3f(1, -1, 1)});
  // Its own view, straight down, is that of the camera above it.
  ASSERT_EQ(state.points.size(), 2u);
  EXPECT_EQ(state.points[0].weight, 0.5);
  EXPECT_LT(length(state.points[1].query.view - normalize(Vec3f(1, 0, 1) - seen)), 1e-6f);
  EXPECT_NEAR(state.power, 4, 1e-6);
}

TEST_F(FrozenStateTest, WhatCannotBeTunedIsSaidClearly) {
  add(Vec3f(1, 0, 1), Vec3f(0, 1, 0), 2, 2, 1, Split::heldout);
  EXPECT_NE(refusal().find("none of the 1 receivers is a train one"), std::string::npos);
  add(Vec3f(1, 0, 1), Vec3f(0, 1, 0), 0, 0, 1, Split::train);
  EXPECT_NE(refusal().find("no indirect light"), std::string::npos);
  EXPECT_NE(refusal().find("rooms.gltf, state day"), std::string::npos);
  receivers.points.back().a = receivers.points.back().b = Vec3f(1);
  EXPECT_EQ(refusal(), "");
  for (int& probe : field.probe_of_point) probe = -1;
  EXPECT_NE(refusal().find("no probe of the layout is active"), std::string::npos);
  receivers.samples = 0;
  EXPECT_NE(refusal().find("no path-traced truth"), std::string::npos);
}

}  // namespace
}  // namespace probelab
