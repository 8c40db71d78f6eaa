// SPDX-License-Identifier: GPL-3.0-or-later
// Decimated geometry against shapes whose surface is known in closed form, and on meshes that a
// half-edge structure refuses.
#include "scene/ray_proxy.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "base/rng.h"
#include "ray_proxy_helpers.h"

namespace probelab::test {
namespace {

TEST(RayProxy, AFlatRoomCollapsesAndKeepsItsAreaAndVolume) {
  SceneBuilder builder;
  addBox(builder, 41, builder.material(Vec3f(0.5f)), Vec3f(4, 2.5f, 3));
  const Scene scene = builder.finish();
  ASSERT_EQ(scene.geometry->triangles.size(), 20172u);
  const RayProxy proxy = proxyOf(scene, 0.005);
  expectSound(scene, proxy);
  // The 12 triangles that a box needs, and a few where the bound on slivers stops.
  EXPECT_LT(proxy.report.triangles_after, 100u);
  // Faces lie in coordinate planes exactly, so only fp32's rounding of positions in them counts.
  EXPECT_LT(proxy.report.original_to_proxy_m, 1e-6);
  EXPECT_LT(proxy.report.proxy_to_original_m, 1e-6);
  EXPECT_NEAR(volumeOf(*proxy.scene.geometry), 30, 30e-6);
  EXPECT_NEAR(areaOf(*proxy.scene.geometry), 59, 59e-6);
  EXPECT_EQ(proxy.scene.geometry->box.min, scene.geometry->box.min);
  EXPECT_EQ(proxy.scene.geometry->box.max, scene.geometry->box.max);
}

TEST(RayProxy, NoSliversAtAFineBorder) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  const int n = 1200;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 4; ++j) {
      const auto at = [&](int a, int b) {
        return Vec3f(static_cast<float>(i + a) / n, static_cast<float>(j + b) / 4, 0);
      };
      builder.quad(at(0, 0), at(1, 0), at(1, 1), at(0, 1), m);
    }
  const RayProxy proxy = proxyOf(builder.finish(), 0.01);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 2);
  for (std::size_t t = 0; t < proxy.scene.geometry->triangles.size(); ++t) {
    const Geometry& g = *proxy.scene.geometry;
    double longest = 0;
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, length(corner(g, t, (k + 1) % 3) - corner(g, t, k)));
    // No slivers: heights of 1 / 400 of the longest edge at least.
    EXPECT_GE(2 * length(areaVector(g, t)), longest * longest / 401);
  }
}

TEST(RayProxy, ACoarseBoxKeepsItsShape) {
  for (const int n : {1, 2, 3, 5}) {
    SceneBuilder builder;
    addBox(builder, n, builder.material(Vec3f(0.5f)), Vec3f(1, 2, 3));
    const Scene scene = builder.finish();
    const RayProxy proxy = proxyOf(scene, 0.005);
    expectSound(scene, proxy);
    EXPECT_EQ(proxy.report.triangles_after, 12u);
    EXPECT_NEAR(volumeOf(*proxy.scene.geometry), 6, 1e-5);
  }
}

// Blocks on a floor in one piece, in quads so coarse that a whole side is within reach of one
// collapse: flaps from floor to top pass every test at the vertices that go.
TEST(RayProxy, NewEdgesAreNoLongerThanTheirBound) {
  SceneBuilder builder;
  addBox(builder, 30, builder.material(Vec3f(0.5f)), Vec3f(1));
  const Scene scene = builder.finish();  // edges of 0.047 m, a diagonal of 1.73 m
  RayProxyOptions options;
  options.max_error_m = 0.005;
  options.max_edge_share = 0.1;
  const RayProxy proxy = makeRayProxy(scene, options);
  double longest = 0;
  for (std::size_t t = 0; t < proxy.scene.geometry->triangles.size(); ++t)
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, length(corner(*proxy.scene.geometry, t, (k + 1) % 3) -
                                         corner(*proxy.scene.geometry, t, k)));
  EXPECT_LE(longest, 0.17321);
  EXPECT_GT(longest, 0.12);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 3);
}

TEST(RayProxy, BlocksOnAFloorKeepTheirShape) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  const int n = 9;
  const auto height = [](int i, int j) {
    const auto inside = [](int k, int low, int high) { return k >= low && k < high; };
    if (inside(i, 1, 4) && inside(j, 1, 3)) return 1.0f;
    return inside(i, 5, 7) && inside(j, 2, 8) ? 2.0f : 0.0f;
  };
  const auto at = [](int i, int j, float z) {
    return Vec3f(static_cast<float>(i), static_cast<float>(j), z);
  };
  double area = 0, volume = 0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const float h = height(i, j);
      builder.quad(at(i, j, h), at(i + 1, j, h), at(i + 1, j + 1, h), at(i, j + 1, h), m);
      volume += static_cast<double>(h);
      area += 1;
      const float x = height(i + 1, j), y = height(i, j + 1);
      for (float z = std::min(h, x); z < std::max(h, x); ++z, ++area) {
        const Vec3f a = at(i + 1, j, z), b = at(i + 1, j + 1, z), up(0, 0, 1);
        h > x ? builder.quad(a, b, b + up, a + up, m) : builder.quad(b, a, a + up, b + up, m);
      }
      for (float z = std::min(h, y); z < std::max(h, y); ++z, ++area) {
        const Vec3f a = at(i, j + 1, z), b = at(i + 1, j + 1, z), up(0, 0, 1);
        h > y ? builder.quad(b, a, a + up, b + up, m) : builder.quad(a, b, b + up, a + up, m);
      }
    }
  const Scene scene = builder.finish();
  ASSERT_NEAR(areaOf(*scene.geometry), area, 1e-4);
  const RayProxy proxy = proxyOf(scene, 0.005);
  expectSound(scene, proxy);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 2);
  EXPECT_NEAR(areaOf(*proxy.scene.geometry), area, 1e-4);
  // Above the plane through the origin's corner: the floor adds nothing, its border is in it.
  double above = 0;
  for (std::size_t t = 0; t < proxy.scene.geometry->triangles.size(); ++t) {
    const Geometry& g = *proxy.scene.geometry;
    above += areaVector(g, t).z * (corner(g, t, 0).z + corner(g, t, 1).z + corner(g, t, 2).z) / 3;
  }
  EXPECT_NEAR(above, volume, 1e-4);
}

TEST(RayProxy, ASphereStaysWithinTheBoundAndItsOwnSagitta) {
  for (const double bound : {0.005, 0.02}) {
    SceneBuilder builder;
    builder.sphere(Vec3f(0), 1, 4, builder.material(Vec3f(0.5f)), false, true);
    const Scene scene = builder.finish();
    // How far the middle of a chordal triangle is below the sphere, at most.
    double sagitta = 0;
    forPoints(*scene.geometry, [&](const Vec3d& p, std::size_t, const Vec3d&) {
      sagitta = std::max(sagitta, 1 - length(p));
    });
    const RayProxy proxy = proxyOf(scene, bound);
    expectSound(scene, proxy);
    EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 2);
    const Geometry& g = *proxy.scene.geometry;
    for (const Vec3f& p : g.positions) EXPECT_NEAR(length(Vec3d(p)), 1, 1e-6);
    double worst = 0;
    forPoints(g, [&](const Vec3d& p, std::size_t t, const Vec3d& w) {
      EXPECT_LT(length(p), 1 + 1e-6);  // chords of a convex body
      worst = std::max(worst, 1 - length(p));
      Vec3d normal;
      for (int k = 0; k < 3; ++k)
        normal += Vec3d(g.normals[g.triangles[t].vertex[k]]) * w[static_cast<std::size_t>(k)];
      // Vertex normals are radial here, so their mean is the point itself.
      EXPECT_NEAR(dot(normalize(normal), normalize(p)), 1, 1e-6);
    });
    // The report samples; between its samples a triangle bulges by a little more at most.
    EXPECT_LE(worst, bound * 1.02 + sagitta + 1e-6);
    EXPECT_GT(worst, bound * 0.5);  // the bound is used
  }
}

TEST(RayProxy, TheBorderOfASheetStaysVertexByVertex) {
  SceneBuilder builder;
  addSheet(builder, 30, builder.material(Vec3f(0.5f)), [](float u, float v) {
    return Vec3f(u, v, 0.002f * std::sin(20 * u) * std::cos(17 * v));
  });
  const Scene scene = builder.finish();
  const RayProxy proxy = proxyOf(scene, 0.005);
  expectSound(scene, proxy);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 4);
  const std::set<Edge> border = edgesWithFaces(*scene.geometry, 0, 1);
  EXPECT_EQ(border.size(), 120u);
  EXPECT_EQ(edgesWithFaces(*proxy.scene.geometry, 0, 1), border);
}

TEST(RayProxy, EdgesBetweenMaterialsAndMeshesStayOnBothSides) {
  for (const bool two_meshes : {false, true}) {
    SceneBuilder builder;
    const uint32_t a = builder.material(Vec3f(0.5f)), b = builder.material(Vec3f(0.2f));
    const auto wave = [](float x, float y) {
      return Vec3f(x, y, 0.002f * std::sin(20 * x) * std::cos(17 * y));
    };
    addSheet(builder, 24, a, wave);
    if (two_meshes) oneMesh(builder, "first");
    addSheet(builder, 24, two_meshes ? a : b, [&](float u, float v) { return wave(1 + u, v); });
    if (two_meshes) oneMesh(builder, "second");
    const Scene scene = builder.finish();
    const RayProxy proxy = proxyOf(scene, 0.005);
    expectSound(scene, proxy);
    EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 4);
    std::set<Edge> seam;
    for (const auto& [edge, count] : edgesOf(*scene.geometry, a))
      if (std::get<0>(edge.first) == 1 && std::get<0>(edge.second) == 1) seam.insert(edge);
    ASSERT_EQ(seam.size(), 24u);
    for (const uint32_t m : {a, two_meshes ? a : b}) {
      const auto after = edgesOf(*proxy.scene.geometry, m);
      for (const Edge& edge : seam) EXPECT_EQ(after.count(edge), 1u);
    }
  }
}

TEST(RayProxy, MeshRangesStillCoverTheirTriangles) {
  SceneBuilder builder;
  const uint32_t a = builder.material(Vec3f(0.5f)), b = builder.material(Vec3f(0.2f));
  addSheet(builder, 10, a, [](float u, float v) { return Vec3f(u, v, 0); });
  oneMesh(builder, "one");
  addSheet(builder, 12, b, [](float u, float v) { return Vec3f(u, v, 1); });
  oneMesh(builder, "two");
  addSheet(builder, 5, a, [](float u, float v) { return Vec3f(u, v, 2); });  // of no mesh
  const RayProxy proxy = proxyOf(builder.finish(), 0.001);
  const Geometry& g = *proxy.scene.geometry;
  ASSERT_EQ(g.meshes.size(), 2u);
  EXPECT_EQ(g.meshes[0].first_triangle, 0u);
  EXPECT_EQ(g.meshes[1].first_triangle, g.meshes[0].triangle_count);
  const float heights[] = {0, 1};
  for (int m = 0; m < 2; ++m)
    for (uint32_t t = 0; t < g.meshes[m].triangle_count; ++t) {
      const Triangle& triangle = g.triangles[g.meshes[m].first_triangle + t];
      EXPECT_EQ(triangle.material, m == 0 ? a : b);
      for (const uint32_t v : triangle.vertex) EXPECT_EQ(g.positions[v].z, heights[m]);
    }
  EXPECT_GT(g.triangles.size(), g.meshes[1].first_triangle + g.meshes[1].triangle_count);
}

TEST(RayProxy, EdgesOfThreeFacesStay) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  for (int fin = 0; fin < 3; ++fin)
    addSheet(builder, 12, m, [&](float u, float v) {
      const float angle = 2.1f * static_cast<float>(fin);
      return Vec3f(u * std::cos(angle), v, u * std::sin(angle));
    });
  const Scene scene = builder.finish();
  const RayProxy proxy = proxyOf(scene, 0.003);
  expectSound(scene, proxy);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 2);
  EXPECT_EQ(edgesWithFaces(*scene.geometry, m, 3).size(), 12u);
  EXPECT_EQ(edgesWithFaces(*proxy.scene.geometry, m, 3), edgesWithFaces(*scene.geometry, m, 3));
  EXPECT_NEAR(areaOf(*proxy.scene.geometry), 3, 3e-5);
}

// One vertex of a plane pulled over its neighbours: faces turned over within the plane.
TEST(RayProxy, FoldsStayAsTheyAre) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  const auto pulled = [](float u, float v) {
    return u == 0.5f && v == 0.5f ? Vec3f(0.82f, 0.61f, 0) : Vec3f(u, v, 0);
  };
  addSheet(builder, 16, m, pulled);
  const Scene scene = builder.finish();
  const RayProxy proxy = proxyOf(scene, 0.01);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 2);
  EXPECT_GT(areaOf(*scene.geometry), 1.02);
  EXPECT_NEAR(areaOf(*proxy.scene.geometry), areaOf(*scene.geometry), 1e-5);
}

TEST(RayProxy, DuplicateAndDegenerateFacesAreKept) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  const auto flat = [](float u, float v) { return Vec3f(u, v, 0); };
  addSheet(builder, 8, m, flat);
  addSheet(builder, 8, m, flat);                                          // the same again
  addSheet(builder, 8, m, [&](float u, float v) { return flat(v, u); });  // and its back
  builder.triangle(Vec3f(3, 0, 0), Vec3f(4, 0, 0), Vec3f(5, 0, 0), m);    // a line
  builder.triangle(Vec3f(3, 1, 0), Vec3f(3, 1, 0), Vec3f(3, 1, 0), m);    // a point
  builder.triangle(Vec3f(3, 2, 0), Vec3f(4, 2, 0), Vec3f(3, 3, 0), m);    // one by itself
  const Scene scene = builder.finish();
  const RayProxy proxy = proxyOf(scene, 0.01);
  EXPECT_EQ(proxy.report.triangles_after, proxy.report.triangles_before);
  ASSERT_EQ(proxy.report.left_alone.size(), 1u);
  EXPECT_EQ(proxy.report.left_alone[0].triangles, 3u * 128 + 3);
  EXPECT_FALSE(proxy.report.left_alone[0].reason.empty());
}

TEST(RayProxy, AnyTriangleSoupIsSurvived) {
  EXPECT_EQ(proxyOf(SceneBuilder().finish(), 0.01).report.triangles_after, 0u);
  for (uint64_t round = 0; round < 300; ++round) {
    SCOPED_TRACE(round);
    Rng rng(round, RngStream::test);
    SceneBuilder builder;
    const uint32_t materials = 1 + static_cast<uint32_t>(rng.nextBelow(2));
    for (uint32_t m = 0; m < materials; ++m) builder.material(Vec3f(0.5f));
    const uint64_t side = 2 + rng.nextBelow(3);  // few places, so that everything meets everything
    const auto random = [&] { return static_cast<float>(rng.nextBelow(side)); };
    for (int v = 0; v < 40; ++v) {
      builder.vertex(Vec3f(random(), random(), round % 2 == 0 ? 0.0f : random()));
      if (round % 3 == 0) builder.geometry().normals.push_back(Vec3f(0, 0, 1));
    }
    if (round % 50 == 7) builder.geometry().positions[3].x = std::nanf("");
    for (int t = 0; t < 60; ++t) {
      const auto v = [&] { return static_cast<uint32_t>(rng.nextBelow(40)); };
      builder.geometry().triangles.push_back(
          {{v(), v(), v()}, static_cast<uint32_t>(rng.nextBelow(materials))});
    }
    const Scene scene = builder.finish();
    expectSound(scene, proxyOf(scene, 0.3));
  }
}

// A dented sheet with faces missing, turned over, doubled and crossing: nothing of it may get lost.
TEST(RayProxy, BrokenSheetsStayWithinTheBound) {
  for (uint64_t round = 0; round < 10; ++round) {
    SCOPED_TRACE(round);
    Rng rng(round, RngStream::test, 1);
    SceneBuilder builder;
    const uint32_t m = builder.material(Vec3f(0.5f));
    const int n = 24;
    const auto at = [&](int i, int j) {
      return Vec3f(static_cast<float>(i) / n, static_cast<float>(j) / n,
                   0.003f * std::sin(0.7f * static_cast<float>(i * j % 97)));
    };
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const uint64_t kind = rng.nextBelow(40);
        if (kind == 0) continue;
        if (kind == 1)
          builder.quad(at(i, j + 1), at(i + 1, j + 1), at(i + 1, j), at(i, j), m);
        else
          builder.quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1), m);
        if (kind == 2) builder.quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1), m);
        if (kind == 3) builder.triangle(at(i, j), at(i + 1, j), Vec3f(0.5f, 0.5f, 1), m);
      }
    const Scene scene = builder.finish();
    const RayProxy proxy = proxyOf(scene, 0.01);
    expectSound(scene, proxy);
    EXPECT_TRUE(proxy.report.left_alone.empty());
    EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before);
    // Every edge with one, three or more faces is still there, with as many.
    const auto before = edgesOf(*scene.geometry, m);
    const auto after = edgesOf(*proxy.scene.geometry, m);
    for (const auto& [edge, count] : before) {
      if (count == 2) continue;
      ASSERT_EQ(after.count(edge), 1u);
      EXPECT_EQ(after.at(edge), count);
    }
  }
}

TEST(RayProxy, TheSameBytesWhateverTheThreads) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  for (int i = 0; i < 4; ++i) {
    builder.sphere(Vec3f(3.0f * static_cast<float>(i), 0, 0), 1, 3, m, false, true);
    oneMesh(builder, "sphere");
  }
  const Scene scene = builder.finish();
  const auto run = [&](int threads) {
    const ThreadLimit limit(threads);
    return proxyOf(scene, 0.03);
  };
  const RayProxy one = run(1), all = run(0);
  const Geometry &a = *one.scene.geometry, &b = *all.scene.geometry;
  EXPECT_LT(a.triangles.size(), scene.geometry->triangles.size() / 2);
  ASSERT_EQ(a.triangles.size(), b.triangles.size());
  EXPECT_EQ(
      std::memcmp(a.triangles.data(), b.triangles.data(), a.triangles.size() * sizeof(Triangle)),
      0);
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(one.report.original_to_proxy_m, all.report.original_to_proxy_m);
}

TEST(RayProxy, EverythingButTheGeometryIsAsItWas) {
  SceneBuilder builder;
  addBox(builder, 6, builder.material(Vec3f(0.5f), Vec3f(1)), Vec3f(1));
  builder.sun(Vec3f(0, -1, 0), Vec3f(3));
  builder.camera(Vec3f(0.5f), Vec3f(1));
  Scene scene = builder.finish();
  scene.origin = Vec3d(10, 20, 30);
  const RayProxy proxy = proxyOf(scene, 0.01);
  EXPECT_EQ(proxy.scene.origin, scene.origin);
  EXPECT_EQ(proxy.scene.bounds.min, scene.bounds.min);
  EXPECT_EQ(proxy.scene.bounds.max, scene.bounds.max);
  EXPECT_EQ(proxy.scene.materials.size(), 1u);
  EXPECT_EQ(proxy.scene.materials[0].emission, Vec3f(1));
  EXPECT_EQ(proxy.scene.lights.size(), 1u);
  EXPECT_EQ(proxy.scene.cameras.size(), 1u);
  EXPECT_EQ(proxy.scene.content_hash, scene.content_hash);
}

TEST(RayProxy, TheBoundIsAQuarterOfTheThinnestWallAtMost) {
  const double none = std::numeric_limits<double>::infinity();
  EXPECT_EQ(proxyErrorBound(0.01, none), 0.01);
  EXPECT_EQ(proxyErrorBound(0.01, 0.02), 0.005);
  EXPECT_EQ(proxyErrorBound(0.01, 0.2), 0.01);
  EXPECT_EQ(proxyErrorBound(0.01, 0), 0);
  EXPECT_THROW(proxyErrorBound(-1, 1), InputError);
  EXPECT_THROW(proxyErrorBound(none, 1), InputError);
  EXPECT_THROW(proxyErrorBound(0.01, -1), InputError);
  EXPECT_THROW(proxyErrorBound(0.01, std::nan("")), InputError);
}

TEST(RayProxy, BadOptionsAreRefused) {
  SceneBuilder builder;
  builder.quad(Vec3f(0), Vec3f(1, 0, 0), Vec3f(1, 1, 0), Vec3f(0, 1, 0), 0);
  const Scene scene = builder.finish();  // without a material
  EXPECT_THROW(proxyOf(scene, 0.01), InputError);
  EXPECT_THROW(proxyOf(SceneBuilder().finish(), -0.01), InputError);
  EXPECT_THROW(proxyOf(SceneBuilder().finish(), std::nan("")), InputError);
}

}  // namespace
}  // namespace probelab::test
