// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/vec.h"

#include <gtest/gtest.h>

namespace probelab {
namespace {

TEST(Vec, CrossIsRightHandedAndOrthogonal) {
  EXPECT_EQ(cross(Vec3d(1, 0, 0), Vec3d(0, 1, 0)), Vec3d(0, 0, 1));
  const Vec3d a(1, 2, 3), b(-4, 5, 6);
  EXPECT_EQ(dot(cross(a, b), a), 0);
  EXPECT_EQ(dot(cross(a, b), b), 0);
}

TEST(Vec, LuminanceOfWhiteIsOne) { EXPECT_NEAR(luminance(Vec3d(1.0)), 1.0, 1e-15); }

TEST(Box, GrowsFromEmpty) {
  Box3f box;
  EXPECT_TRUE(box.empty());
  box.extend({1, 2, 3});
  EXPECT_FALSE(box.empty());
  box.extend({-1, 2, 5});
  EXPECT_EQ(box.extent(), Vec3f(2, 0, 2));
  EXPECT_EQ(box.center(), Vec3f(0, 2, 4));
  EXPECT_TRUE(box.contains({0, 2, 4}));
  EXPECT_FALSE(box.contains({0, 2.1f, 4}));
}

TEST(Transform, ProductAppliesTheRightFactorFirst) {
  Mat4d move, turn;  // by (1, 0, 0); a quarter turn about z
  move.m[0][3] = 1;
  turn.m[0][0] = 0, turn.m[0][1] = -1, turn.m[1][0] = 1, turn.m[1][1] = 0;
  EXPECT_EQ(transformPoint(turn * move, {0, 0, 0}), Vec3d(0, 1, 0));
  EXPECT_EQ(transformPoint(move * turn, {0, 0, 0}), Vec3d(1, 0, 0));
  EXPECT_EQ(transformVector(turn * move, {1, 0, 0}), Vec3d(0, 1, 0));
}

}  // namespace
}  // namespace probelab
