// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/reachability.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/rng.h"
#include "scene_builders.h"
#include "trace/wall_thickness.h"

namespace probelab::test {
namespace {

// Two rooms with walls of 20 cm, joined or not, and whatever each test adds.
SceneBuilder twoRooms(bool door) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  builder.box(Vec3f(-0.2f, -0.2f, -0.2f), Vec3f(8.2f, 3.2f, 4.2f), m, false);
  builder.box(Vec3f(0), Vec3f(8, 3, 4), m, true);
  if (door) {
    builder.box(Vec3f(3.9f, 0, 0), Vec3f(4.1f, 3, 1.5f), m, false);
    builder.box(Vec3f(3.9f, 0, 2.4f), Vec3f(4.1f, 3, 4), m, false);
  } else {
    builder.box(Vec3f(3.9f, 0, 0), Vec3f(4.1f, 3, 4), m, false);
  }
  return builder;
}

void expectBox(const Box3f& box, const Vec3f& lo, const Vec3f& hi, float tolerance) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(box.min[axis], lo[axis], tolerance) << "axis " << axis;
    EXPECT_NEAR(box.max[axis], hi[axis], tolerance) << "axis " << axis;
  }
}

TEST(Reachability, FurnaceBoxIsTheRoomItself) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(1), builder.material(Vec3f(0.5f)), true);
  builder.camera(Vec3f(0.5f), Vec3f(1, 0.5f, 0.5f));
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  const Reachability r = findReachable(scene, embree);
  EXPECT_TRUE(r.anchored);
  expectBox(r.reachable_box, Vec3f(0), Vec3f(1), 1e-5f);
  EXPECT_EQ(r.regions[0].cameras, std::vector<uint32_t>{0});
  EXPECT_FALSE(r.regions[0].touches_bounds);
  EXPECT_NEAR(r.regions[0].volume_m3, 1, 0.06);  // two layers of occupied cells of 128
}

TEST(Reachability, ClosedRoomsAreRegionsOfTheirOwn) {
  SceneBuilder builder = twoRooms(false);
  builder.camera(Vec3f(1, 1, 1), Vec3f(2, 1, 1));
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  const Reachability r = findReachable(scene, embree);
  const int left = regionOf(r, embree, Vec3f(1, 1, 1)), right = regionOf(r, embree, Vec3f(7, 1, 1));
  ASSERT_GE(left, 0);
  ASSERT_GE(right, 0);
  EXPECT_NE(left, right);
  EXPECT_TRUE(isReachable(r, embree, Vec3f(2, 2, 2)));
  EXPECT_FALSE(isReachable(r, embree, Vec3f(7, 2, 2)));
  expectBox(r.reachable_box, Vec3f(0), Vec3f(3.9f, 3, 4), 1e-4f);
}

TEST(Reachability, ADoorJoinsRooms) {
  SceneBuilder builder = twoRooms(true);
  builder.scene().receiver_seeds.push_back(Vec3f(1, 1, 1));
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  const Reachability r = findReachable(scene, embree);
  EXPECT_TRUE(isReachable(r, embree, Vec3f(7, 2, 2)));
  EXPECT_EQ(r.regions[0].seeds, std::vector<uint32_t>{0});
  expectBox(r.reachable_box, Vec3f(0), Vec3f(8, 3, 4), 1e-4f);
}

TEST(Reachability, WithoutCameraOrSeedEnclosedRoomsCountAndSolidWallsDoNot) {
  const Scene scene = twoRooms(false).finish();
  const EmbreeScene embree(scene);
  const Reachability r = findReachable(scene, embree);
  EXPECT_FALSE(r.anchored);
  EXPECT_TRUE(isReachable(r, embree, Vec3f(2, 2, 2)));
  EXPECT_TRUE(isReachable(r, embree, Vec3f(7, 2, 2)));
  EXPECT_FALSE(isReachable(r, embree, Vec3f(4, 2, 2)));       // inside the wall between
  EXPECT_FALSE(isReachable(r, embree, Vec3f(-0.1f, 1, 1)));   // inside the outer wall
  EXPECT_FALSE(isReachable(r, embree, Vec3f(-0.25f, 1, 1)));  // outside
}

TEST(Reachability, OpenScenesCountWhole) {
  SceneBuilder builder;
  builder.quad(Vec3f(-1, 0, 1), Vec3f(1, 0, 1), Vec3f(1, 0, -1), Vec3f(-1, 0, -1),
               builder.material(Vec3f(0.5f)));
  builder.scene().bounds = {Vec3f(-2), Vec3f(2)};
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  const Reachability r = findReachable(scene, embree);
  EXPECT_TRUE(isReachable(r, embree, Vec3f(0, 1, 0)));
  EXPECT_TRUE(isReachable(r, embree, Vec3f(0, -1, 0)));
  expectBox(r.reachable_box, Vec3f(-2), Vec3f(2), 1e-5f);
}

// Points a hair off a wall, in edges and in the deepest part of a sharp wedge are decided too.
TEST(Reachability, PointsInOccupiedCellsFindTheirRoom) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  // A prism whose cross-section in xy is a triangle with an angle of 8 degrees at the origin.
  const Vec3f a(0, 0, 0), b(10, -0.7f, 0), c(10, 0.7f, 0), z(0, 0, 3);
  builder.triangle(a, b, c, m);
  builder.triangle(a + z, c + z, b + z, m);
  builder.quad(a, a + z, b + z, b, m);
  builder.quad(b, b + z, c + z, c, m);
  builder.quad(c, c + z, a + z, a, m);
  builder.scene().receiver_seeds.push_back(Vec3f(8, 0, 1.5f));
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  const Reachability r = findReachable(scene, embree);
  EXPECT_TRUE(isReachable(r, embree, Vec3f(0.02f, 0, 1)));
  EXPECT_TRUE(isReachable(r, embree, Vec3f(9.9999f, 0.5f, 1e-4f)));
  EXPECT_FALSE(isReachable(r, embree, Vec3f(5, 0.38f, 1)));
}

TEST(Reachability, ThinWallsKeepTheirSides) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  builder.shell(Vec3f(0), Vec3f(4), 0.001f, m, m);
  builder.scene().bounds = {Vec3f(-1), Vec3f(5)};
  builder.scene().receiver_seeds.push_back(Vec3f(2));
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  const Reachability r = findReachable(scene, embree);
  Rng rng(1, RngStream::test);
  for (int i = 0; i < 300; ++i) {
    const Vec3f p(4, 4 * rng.nextFloat(), 4 * rng.nextFloat());
    EXPECT_TRUE(isReachable(r, embree, p - Vec3f(1e-4f, 0, 0)));
    EXPECT_FALSE(isReachable(r, embree, p + Vec3f(0.0005f, 0, 0)));  // in the wall
    EXPECT_FALSE(isReachable(r, embree, p + Vec3f(0.0012f, 0, 0)));  // outside
  }
}

TEST(Reachability, ASeedInSolidGeometryOrOutsideIsAnError) {
  for (const Vec3f& seed : {Vec3f(20, 1, 1)}) {
    SceneBuilder builder = twoRooms(false);
    builder.scene().receiver_seeds.push_back(seed);
    const Scene scene = builder.finish();
    const EmbreeScene embree(scene);
    EXPECT_THROW(findReachable(scene, embree), InputError);
  }
}

TEST(Reachability, FlatBoundsAreAnError) {
  SceneBuilder builder = twoRooms(false);
  builder.scene().bounds = {Vec3f(0), Vec3f(1, 1, 0)};
  const Scene scene = builder.finish();
  EXPECT_THROW(findReachable(scene, EmbreeScene(scene)), InputError);
}

TEST(WallThickness, IsTheThinnestWallOfARoom) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  builder.shell(Vec3f(-2, 0, -1), Vec3f(2, 3, 1), 0.1f, m, m);
  builder.shell(Vec3f(5, 0, -1), Vec3f(6, 3, 1), 0.02f, m, m);
  const Scene scene = builder.finish();
  const WallThickness w = measureWallThickness(scene, EmbreeScene(scene));
  EXPECT_TRUE(w.has_walls);
  EXPECT_NEAR(w.thinnest_m, 0.02f, 1e-5f);
  EXPECT_GT(w.place.x, 4.9f);
  EXPECT_EQ(w.sheet_share, 0);
}

TEST(WallThickness, SingleSheetsHaveNone) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(1), builder.material(Vec3f(0.5f)), true);
  const Scene scene = builder.finish();
  const WallThickness w = measureWallThickness(scene, EmbreeScene(scene));
  EXPECT_FALSE(w.has_walls);
  EXPECT_EQ(w.sheet_share, 1);
}

}  // namespace
}  // namespace probelab::test
