// SPDX-License-Identifier: GPL-3.0-or-later
// Clearance and the inside test against closed forms.
#include "placement/distance.h"

#include <gtest/gtest.h>

#include <limits>

#include "base/rng.h"
#include "places.h"

namespace probelab::test {
namespace {

#ifdef PROBELAB_WITH_CGAL

// Distance to the surface of an axis-aligned box.
double boxDistance(const Vec3d& p, const Vec3d& lo, const Vec3d& hi) {
  const Vec3d outside = componentMax(componentMax(lo - p, p - hi), Vec3d());
  if (dot(outside, outside) > 0) return length(outside);
  return minComponent(componentMin(p - lo, hi - p));
}

TEST(SceneDistance, OfABoxIsTheClosedFormAtAnyScale) {
  for (const float scale : {1e-3f, 1.0f, 1e3f}) {
    SceneBuilder b;
    const Vec3f lo = scaled(scale, -1, -0.5f, -2), hi = scaled(scale, 1, 0.5f, 2);
    b.box(lo, hi, b.material(Vec3f(0.5f)), false);
    const Scene scene = b.finish();
    const SceneDistance distance(*scene.geometry);
    Rng rng(3, RngStream::test);
    for (int i = 0; i < 2000; ++i) {
      Vec3f p;
      for (std::size_t axis = 0; axis < 3; ++axis) p[axis] = scale * (6 * rng.nextFloat() - 3);
      const double expected = boxDistance(Vec3d(p), Vec3d(lo), Vec3d(hi));
      // Doubles throughout; corners are floats already.
      EXPECT_NEAR(distance.clearance(p), expected, 1e-12 * static_cast<double>(scale));
      const ClosestPoint closest = *distance.closest(p);
      EXPECT_NEAR(closest.distance_m, expected, 1e-12 * static_cast<double>(scale));
      EXPECT_NEAR(boxDistance(closest.point, Vec3d(lo), Vec3d(hi)), 0,
                  1e-12 * static_cast<double>(scale));
    }
  }
}

// A fan whose triangles all begin at one vertex: as many points in one place as there are triangles.
TEST(SceneDistance, SurvivesAnyNumberOfTrianglesAtOnePlace) {
  SceneBuilder b;
  const uint32_t material = b.material(Vec3f(0.5f));
  constexpr int kTriangles = 200000;
  for (int i = 0; i < kTriangles; ++i) {
    const auto angle = [](int k) { return 6.2831853f * static_cast<float>(k) / kTriangles; };
    const float from = angle(i), to = angle(i + 1);
    b.triangle({0, 0, 0}, {std::cos(from), 0, std::sin(from)}, {std::cos(to), 0, std::sin(to)},
               material);
  }
  const Scene scene = b.finish();
  const SceneDistance distance(*scene.geometry);
  EXPECT_NEAR(distance.clearance({0.3f, 0.25f, 0.1f}), 0.25, 1e-6);
  EXPECT_NEAR(distance.clearance({2, 0, 0}), 1, 1e-6);
}

TEST(SceneDistance, OfASphereIsTheClosedFormToTheMeshsSagitta) {
  SceneBuilder b;
  const int levels = 4;
  b.sphere({1, 2, 3}, 2, levels, b.material(Vec3f(0.5f)), false);
  const Scene scene = b.finish();
  const SceneDistance distance(*scene.geometry);
  // An edge of the icosahedron spans 63.4 degrees, halved at each level (at most 1.3 times as long
  // as the mean); faces lie inside the sphere by r (1 - cos of the circumradius' angle).
  const double angle = 1.107 * 1.3 / (1 << levels) / std::sqrt(3.0);
  const double sagitta = 2 * (1 - std::cos(angle));
  for (const float radius : {0.0f, 0.5f, 1.5f, 2.5f, 7.0f}) {
    const Vec3f p = Vec3f(1, 2, 3) + normalize(Vec3f(0.3f, -0.5f, 0.8f)) * radius;
    EXPECT_NEAR(distance.clearance(p), std::abs(2.0 - static_cast<double>(radius)), sagitta + 1e-6);
  }
}

TEST(SceneDistance, ClosestPointNamesItsTriangleAndNormal) {
  SceneBuilder b;
  b.quad({0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}, b.material(Vec3f(0.5f)));
  const Scene scene = b.finish();
  const SceneDistance distance(*scene.geometry);
  const ClosestPoint closest = *distance.closest({0.9f, 0.25f, 0.5f});
  EXPECT_NEAR(closest.distance_m, 0.25, 1e-12);
  EXPECT_NEAR(closest.normal.y, 1, 1e-6);
  EXPECT_LT(closest.triangle, 2u);
}

TEST(SceneDistance, WithoutTrianglesIsInfinite) {
  const Scene scene = emptySpace();
  const SceneDistance distance(*scene.geometry);
  EXPECT_EQ(distance.clearance({0, 0, 0}), std::numeric_limits<double>::infinity());
  EXPECT_FALSE(distance.closest({0, 0, 0}));
}

#endif

TEST(InsideSolid, HoldsInABoxAndNotAroundItAtAnyScale) {
  for (const float scale : {1e-3f, 1.0f, 1e3f}) {
    SceneBuilder b;
    b.box(scaled(scale, -1, -1, -1), scaled(scale, 1, 1, 1), b.material(Vec3f(0.5f)), false);
    const Scene scene = b.finish();
    const EmbreeScene embree(scene);
    EXPECT_TRUE(isInsideSolid(scene, embree, scaled(scale, 0, 0, 0)));
    EXPECT_TRUE(isInsideSolid(scene, embree, scaled(scale, 0.99f, -0.99f, 0.99f)));
    EXPECT_FALSE(isInsideSolid(scene, embree, scaled(scale, 1.01f, 0, 0)));
    EXPECT_FALSE(isInsideSolid(scene, embree, scaled(scale, 0, 5, 0)));
  }
}

TEST(InsideSolid, HoldsWhereAFaceIsMissing) {
  SceneBuilder b;
  b.box({-1, -1, -1}, {1, 1, 1}, b.material(Vec3f(0.5f)), false);
  b.geometry().triangles.resize(10);
  const Scene scene = b.finish();
  const EmbreeScene embree(scene);
  EXPECT_TRUE(isInsideSolid(scene, embree, {0, 0, 0}));
  EXPECT_FALSE(isInsideSolid(scene, embree, {0, 0, -1.5f}));
  EXPECT_FALSE(isInsideSolid(scene, embree, {0, 0, 1.5f}));
}

// Counting crossings fails on both: they are even in the overlap and between doubled faces.
TEST(InsideSolid, HoldsInOverlapsAndBetweenDoubledFaces) {
  SceneBuilder b;
  const uint32_t m = b.material(Vec3f(0.5f));
  b.box({-1, -1, -1}, {1, 1, 1}, m, false);
  b.box({0, -1, -1}, {2, 1, 1}, m, false);
  b.box({0, -1, -1}, {2, 1, 1}, m, false);
  const Scene scene = b.finish();
  const EmbreeScene embree(scene);
  EXPECT_TRUE(isInsideSolid(scene, embree, {0.5f, 0, 0}));
  EXPECT_TRUE(isInsideSolid(scene, embree, {1.5f, 0.1f, 0}));
  EXPECT_FALSE(isInsideSolid(scene, embree, {2.5f, 0, 0}));
}

TEST(InsideSolid, DoesNotHoldInARoomNorBesideASheet) {
  SceneBuilder b;
  const uint32_t m = b.material(Vec3f(0.5f));
  b.box({-2, -2, -2}, {2, 2, 2}, m, true);
  b.quad({-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, b.material(Vec3f(0.5f), Vec3f(), true));
  const Scene scene = b.finish();
  const EmbreeScene embree(scene);
  EXPECT_FALSE(isInsideSolid(scene, embree, {0, 0, 0.1f}));
  EXPECT_FALSE(isInsideSolid(scene, embree, {0, 0, -0.1f}));
}

TEST(LineFree, EndsAtWallsFromBothSides) {
  const Place place(twoRooms());
  EXPECT_TRUE(isLineFree(place.embree, {-2, 1, 1}, {-1, 2, 2}));
  EXPECT_FALSE(isLineFree(place.embree, {-1, 1, 1}, {1, 1, 1}));
  EXPECT_FALSE(isLineFree(place.embree, {1, 1, 1}, {-1, 1, 1}));
  EXPECT_TRUE(isLineFree(place.embree, {1, 1, 1}, {1, 1, 1}));
}

TEST(FreeSpace, HasTheVolumeOfTheRoomWithoutThePillar) {
  Place place(pillarRoom());
  const PlacementInput input = place.input(8);
  const FreeSpace space(input);
  // 4,096 samples, about 0.9 of them usable: standard error 0.5 %; 4 of them.
  EXPECT_NEAR(space.volume(), 4 * 3 * 5 - 3, 0.02 * 57);
  Rng rng(1, RngStream::test);
  for (int i = 0; i < 200; ++i) {
    const Vec3f p = space.sample(rng);
    EXPECT_TRUE(p.x > 0 && p.x < 4 && p.y > 0 && p.y < 3 && p.z > 0 && p.z < 5);
    EXPECT_FALSE(p.x > 1.5f && p.x < 2.5f && p.z > 2 && p.z < 3);
  }
}

}  // namespace
}  // namespace probelab::test
