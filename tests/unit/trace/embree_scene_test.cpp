// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/embree_scene.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "base/rng.h"
#include "scene_builders.h"
#include "shared/light.h"
#include "trace/sampling.h"
#include "trace/surface.h"

namespace probelab::test {
namespace {

Vec3f randomUnit(Rng& rng) {
  const float a = rng.nextFloat(), b = rng.nextFloat();
  return sampleSphere({a, b});
}
Vec3f randomCube(Rng& rng) {
  const float x = rng.nextFloat(), y = rng.nextFloat(), z = rng.nextFloat();
  return Vec3f(2 * x - 1, 2 * y - 1, 2 * z - 1);
}
Ray rayFrom(const Vec3f& origin, const Vec3f& direction) {
  return {origin, 0, direction, kFarDistance};
}

Scene unitBox() {
  SceneBuilder builder;
  builder.box(Vec3f(-1), Vec3f(1), builder.material(Vec3f(0.5f)), true);
  return builder.finish();
}

TEST(EmbreeScene, ReportsDistanceTriangleAndBarycentrics) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  builder.triangle(Vec3f(9, 9, 9), Vec3f(10, 9, 9), Vec3f(9, 10, 9), m);
  builder.triangle(Vec3f(0, 0, 2), Vec3f(4, 0, 2), Vec3f(0, 4, 2), m);
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  const Hit hit = embree.closest(rayFrom(Vec3f(1, 2, 0), Vec3f(0, 0, 1)));
  EXPECT_EQ(hit.primitive, 1u);
  EXPECT_FLOAT_EQ(hit.t, 2);
  EXPECT_FLOAT_EQ(hit.u, 0.25f);
  EXPECT_FLOAT_EQ(hit.v, 0.5f);
  const Hit miss = embree.closest(Ray{Vec3f(1, 2, 0), 0, Vec3f(0, 0, 1), 1.5f});
  EXPECT_EQ(miss.primitive, kNoHit);
  EXPECT_EQ(miss.t, 1.5f);
  EXPECT_TRUE(embree.occluded(rayFrom(Vec3f(1, 2, 0), Vec3f(0, 0, 1))));
  EXPECT_FALSE(embree.occluded(rayFrom(Vec3f(1, 2, 0), Vec3f(0, 0, -1))));
}

TEST(EmbreeScene, AnEmptySceneIsNeverHit) {
  SceneBuilder builder;
  builder.scene().bounds = {Vec3f(-1), Vec3f(1)};
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  EXPECT_EQ(embree.closest(rayFrom(Vec3f(0), Vec3f(0, 1, 0))).primitive, kNoHit);
  EXPECT_FALSE(embree.occluded(rayFrom(Vec3f(0), Vec3f(0, 1, 0))));
  EXPECT_EQ(embree.extent(), 0);
}

TEST(EmbreeScene, EmptyIntervalsAreNotTraced) {
  const Scene scene = unitBox();
  const EmbreeScene embree(scene);
  const std::vector<Ray> rays = {{Vec3f(0), 0, Vec3f(1, 0, 0), 0},
                                 {Vec3f(0), 2, Vec3f(1, 0, 0), 1},
                                 {Vec3f(0), 0, Vec3f(1, 0, 0), 10}};
  std::vector<Hit> hits(3);
  std::vector<uint32_t> blocked(3);
  embree.closest(rays, hits);
  embree.occluded(rays, blocked);
  EXPECT_EQ(hits[0].primitive, kNoHit);
  EXPECT_EQ(hits[1].primitive, kNoHit);
  EXPECT_NE(hits[2].primitive, kNoHit);
  EXPECT_EQ(blocked, (std::vector<uint32_t>{0, 0, 1}));
}

TEST(EmbreeScene, RaysThatAreNotFiniteNameTheirIndex) {
  const Scene scene = unitBox();
  const EmbreeScene embree(scene);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const Ray& bad :
       {Ray{Vec3f(nan, 0, 0), 0, Vec3f(1, 0, 0), 1}, Ray{Vec3f(0), 0, Vec3f(0, nan, 0), 1},
        Ray{Vec3f(0), 0, Vec3f(1, 0, 0), nan}, Ray{Vec3f(0), nan, Vec3f(1, 0, 0), 1},
        Ray{Vec3f(0), 0, Vec3f(1e20f, 0, 0), 1}}) {
    std::vector<Ray> rays(10, rayFrom(Vec3f(0), Vec3f(1, 0, 0)));
    rays[7] = bad;
    std::vector<Hit> hits(10);
    std::vector<uint32_t> blocked(10);
    try {
      embree.closest(rays, hits);
      FAIL() << "no error";
    } catch (const NumericalError& error) {
      EXPECT_NE(std::string(error.what()).find("ray 7"), std::string::npos) << error.what();
    }
    EXPECT_THROW(embree.occluded(rays, blocked), NumericalError);
    EXPECT_THROW(embree.closest(bad), NumericalError);
  }
}

TEST(EmbreeScene, InfiniteLengthIsAllowed) {
  const Scene scene = unitBox();
  const EmbreeScene embree(scene);
  EXPECT_NE(embree.closest(Ray{Vec3f(0), 0, Vec3f(1, 0, 0), INFINITY}).primitive, kNoHit);
}

TEST(EmbreeScene, SameBytesWithOneAndTwoThreads) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  builder.box(Vec3f(-2), Vec3f(2), m, true);
  builder.box(Vec3f(-2), Vec3f(2), m, true);  // coplanar twins: the tree decides which one is hit
  for (int i = 0; i < 20; ++i)
    builder.sphere(Vec3f(static_cast<float>(i) * 0.1f - 1), 0.5f, 4, m, false);
  const Scene scene = builder.finish();
  Rng rng(1, RngStream::test);
  std::vector<Ray> rays;
  for (int i = 0; i < 20000; ++i) rays.push_back(rayFrom(randomCube(rng), randomUnit(rng)));
  const auto trace = [&](int threads) {
    const ThreadLimit limit(threads);
    const EmbreeScene embree(scene);
    std::vector<Hit> hits(rays.size());
    embree.closest(rays, hits);
    return hits;
  };
  const auto one = trace(1), two = trace(2);
  EXPECT_EQ(std::memcmp(one.data(), two.data(), one.size() * sizeof(Hit)), 0);
}

TEST(EmbreeScene, HolesOfMasksLetRaysThrough) {
  SceneBuilder builder;
  Texture texture;  // left half opaque, right half a hole
  texture.width = 2, texture.height = 1;
  texture.rgba = {255, 255, 255, 255, 255, 255, 255, 0};
  builder.scene().textures.push_back(texture);
  Material masked;
  masked.alpha_mask = true;
  masked.base_color_texture.texture = 0;
  masked.base_color_texture.nearest = true;
  const uint32_t solid = builder.material(Vec3f(0.5f));
  builder.quad(Vec3f(0, 0, 5), Vec3f(1, 0, 5), Vec3f(1, 1, 5), Vec3f(0, 1, 5), solid);
  builder.quad(Vec3f(0, 0, 1), Vec3f(1, 0, 1), Vec3f(1, 1, 1), Vec3f(0, 1, 1),
               builder.material(masked));
  for (const Vec3f& p : builder.geometry().positions) builder.geometry().uv0.push_back({p.x, p.y});
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  Rng rng(2, RngStream::test);
  for (int i = 0; i < 200; ++i) {
    const float x = rng.nextFloat(), y = rng.nextFloat();
    const Ray ray = rayFrom(Vec3f(x, y, 0), Vec3f(0, 0, 1));
    const Hit hit = embree.closest(ray);
    EXPECT_EQ(hit.primitive / 2, x < 0.5f ? 1u : 0u) << x;
    EXPECT_FLOAT_EQ(hit.t, x < 0.5f ? 1.0f : 5.0f);
    EXPECT_EQ(embree.occluded(Ray{ray.origin, 0, ray.direction, 3}), x < 0.5f);
  }
}

// Rays from inside a closed sphere, aimed at its vertices and edges. Embree's robust mode closes
// edges; at vertices its maintainers allow a few escapes.
TEST(EmbreeScene, ClosedMeshesLetNothingOutAtEdgesAndAlmostNothingAtVertices) {
  for (const float offset : {0.0f, 1000.0f}) {
    SceneBuilder builder;
    builder.sphere(Vec3f(offset), 1, 4, builder.material(Vec3f(0.5f)), true);
    const Scene scene = builder.finish();
    const EmbreeScene embree(scene);
    Rng rng(3, RngStream::test);
    const Geometry& g = *scene.geometry;
    int vertex_escapes = 0, edge_escapes = 0, face_escapes = 0;
    const int rays = 20000;
    for (int i = 0; i < rays; ++i) {
      const Vec3f origin = Vec3f(offset) + randomCube(rng) * 0.5f;
      const Triangle& t = g.triangles[rng.nextBelow(g.triangles.size())];
      const Vec3f a = g.positions[t.vertex[0]], b = g.positions[t.vertex[1]];
      const float share = rng.nextFloat();
      const auto escapes = [&](const Vec3f& target) {
        return embree.closest(rayFrom(origin, normalize(target - origin))).primitive == kNoHit;
      };
      vertex_escapes += escapes(a);
      edge_escapes += escapes(a * (1 - share) + b * share);
      face_escapes += embree.closest(rayFrom(origin, randomUnit(rng))).primitive == kNoHit;
    }
    EXPECT_LE(vertex_escapes, rays / 200) << "offset " << offset;
    EXPECT_EQ(edge_escapes, 0) << "offset " << offset;
    EXPECT_EQ(face_escapes, 0) << "offset " << offset;
  }
}

struct Reintersect : testing::TestWithParam<int> {};

// A ray that leaves a triangle never hits it again, for coordinates of 1e-3 to 1e6 and triangles as
// large as the coordinates, of one metre (a hundred units in the last place at 1e6), or slivers.
TEST_P(Reintersect, NeverHappens) {
  const float scale = std::pow(10.0f, static_cast<float>(GetParam()));
  int hits = 0;
  for (uint64_t k = 0; k < 600; ++k) {
    Rng rng(4, RngStream::test, static_cast<uint64_t>(GetParam() + 10), k);
    const Vec3f base = randomCube(rng) * scale;
    Vec3f p[3] = {base, randomCube(rng) * scale, randomCube(rng) * scale};
    if (k % 3 == 1) p[1] = base + randomCube(rng), p[2] = base + randomCube(rng);
    if (k % 3 == 2) p[2] = (p[0] + p[1]) * 0.5f + randomCube(rng) * (0.01f * scale);
    if (k % 4 == 0) p[0].x = p[1].x = p[2].x = 0;  // a plane through the origin
    SceneBuilder builder;
    builder.triangle(p[0], p[1], p[2], builder.material(Vec3f(0.5f)));
    const Scene scene = builder.finish();
    if (!(faceArea(*scene.geometry, 0) > 1e-6f * scale * scale) && k % 3 != 1) continue;
    if (k % 3 == 1 && !(faceArea(*scene.geometry, 0) > 0.05f)) continue;
    const EmbreeScene embree(scene);
    const Vec3f normal = faceNormal(*scene.geometry, 0);
    for (int i = 0; i < 300; ++i) {
      const float a = rng.nextFloat(), b = rng.nextFloat();
      const Vec2f uv = sampleTriangle({a, b});
      const BoundedPoint point = pointOnTriangle(p[0], p[1], p[2], uv.x, uv.y);
      const Vec3f direction = randomUnit(rng);
      const Vec3f origin = offsetOrigin(point, normal, direction);
      hits += embree.closest(rayFrom(origin, direction)).primitive != kNoHit;
    }
  }
  EXPECT_EQ(hits, 0);
}
INSTANTIATE_TEST_SUITE_P(Scale, Reintersect, testing::Range(-3, 7));

// A 1 cm wall 1 km from the origin: offsets from one side stay on that side.
TEST(Offsets, DoNotCrossAThinWallFarAway) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  builder.box(Vec3f(1000, -2, -2), Vec3f(1000.01f, 2, 2), m, false);
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  Rng rng(5, RngStream::test);
  for (int i = 0; i < 1000; ++i) {
    const Vec3f target(1000, 3 * rng.nextFloat() - 1.5f, 3 * rng.nextFloat() - 1.5f);
    const Vec3f from(999, 0, 0);
    const Vec3f direction = normalize(target - from);
    const Hit hit = embree.closest(rayFrom(from, direction));
    ASSERT_NE(hit.primitive, kNoHit);
    const Surface s = surfaceAt(*scene.geometry, makeMaterialTable(scene), hit, direction);
    const Vec3f origin = offsetOrigin(s.point, s.geometric_normal, s.geometric_normal);
    EXPECT_TRUE(embree.occluded(Ray{origin, 0, Vec3f(1, 0, 0), 1}));  // back through the wall
    EXPECT_FALSE(embree.occluded(Ray{origin, 0, Vec3f(-1, 0, 0), 1}));
  }
}

}  // namespace
}  // namespace probelab::test
