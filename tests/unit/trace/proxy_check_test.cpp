// SPDX-License-Identifier: GPL-3.0-or-later
// The check of ray proxies: good proxies pass, broken ones are found, distances are as built.
#include "trace/proxy_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "base/rng.h"
#include "scene/load.h"
#include "scene/ray_proxy.h"
#include "scene_builders.h"
#include "shared/light.h"
#include "trace/wall_thickness.h"

namespace probelab::test {
namespace {

// A wall of 1 m by 1 m and `thickness` along z, whose faces wave together; its rim is closed.
Scene wavyWall(float thickness) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  const auto wave = [](float u, float v) { return 0.02f * std::sin(9 * u) * std::cos(7 * v); };
  const float half = 0.5f * thickness;
  const int n = 60;
  addSheet(builder, n, m, [&](float u, float v) { return Vec3f(u, v, wave(u, v) + half); });
  addSheet(builder, n, m, [&](float u, float v) { return Vec3f(v, u, wave(v, u) - half); });
  for (int i = 0; i < n; ++i) {
    const float a = static_cast<float>(i) / n, b = static_cast<float>(i + 1) / n;
    const auto rim = [&](const Vec2f& p, const Vec2f& q) {  // outside is on the right of p to q
      const float zp = wave(p.x, p.y), zq = wave(q.x, q.y);
      builder.quad(Vec3f(p.x, p.y, zp - half), Vec3f(q.x, q.y, zq - half),
                   Vec3f(q.x, q.y, zq + half), Vec3f(p.x, p.y, zp + half), m);
    };
    rim({a, 0}, {b, 0}), rim({1, a}, {1, b}), rim({b, 1}, {a, 1}), rim({0, b}, {0, a});
  }
  return builder.finish();
}

Scene withGeometry(const Scene& scene, const std::function<void(Geometry&)>& change) {
  Scene changed = scene;
  Geometry geometry = *scene.geometry;
  change(geometry);
  changed.geometry = std::make_shared<const Geometry>(std::move(geometry));
  return changed;
}

ProxyCheck check(const Scene& scene, const Scene& proxy, double bound_m, uint32_t samples = 20000) {
  ProxyCheckOptions options;
  options.bound_m = bound_m;
  options.samples = samples;
  return checkProxy(scene, EmbreeScene(scene), proxy, EmbreeScene(proxy), options);
}

double wallOf(const Scene& scene) {
  const WallThickness wall = measureWallThickness(scene, EmbreeScene(scene));
  return wall.has_walls ? static_cast<double>(wall.thinnest_m)
                        : std::numeric_limits<double>::infinity();
}

TEST(ProxyCheck, AWallOfTwoCentimetresLetsNoRayThrough) {
  const Scene scene = wavyWall(0.02f);
  const double bound = proxyErrorBound(0.05, wallOf(scene));
  EXPECT_LE(bound, 0.005);
  EXPECT_GT(bound, 0.0035);  // where the faces are steepest they are nearer than along z
  RayProxyOptions options;
  options.max_edge_share = 1;
  options.max_error_m = bound;
  const RayProxy proxy = makeRayProxy(scene, options);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 3);
  const ProxyCheck result = check(scene, proxy.scene, bound);
  EXPECT_EQ(result.leaks, 0u);
  EXPECT_TRUE(result.holds());
  // Only rays to points within 2 bounds of the rim can miss a rim that moved: 4 m of it by 1 cm, of
  // 2 square metres.
  EXPECT_LT(result.lost, 20000u / 50);
  EXPECT_GT(result.blocked, 20000u);
  // A displacement of the bound seen at up to 60 degrees, and the slope of the wave beside it.
  EXPECT_LT(result.p99_m, 2.6 * bound);
  EXPECT_GT(result.max_m, 0.5 * bound);
}

TEST(ProxyCheck, HolesAreLeaksAndNewWallsAreFalse) {
  const Scene scene = wavyWall(0.02f);
  const ProxyCheck same = check(scene, scene, 0.002);
  EXPECT_EQ(same.leaks + same.false_walls + same.lost + same.other_surface, 0u);
  EXPECT_EQ(same.max_m, 0);
  EXPECT_GT(same.free, 1000u);
  // Both faces lose what lies in a square of 20 cm: 4 % of the area.
  const Scene pierced = withGeometry(scene, [](Geometry& g) {
    std::erase_if(g.triangles, [&](const Triangle& t) {
      const Vec3f c =
          (g.positions[t.vertex[0]] + g.positions[t.vertex[1]] + g.positions[t.vertex[2]]) / 3.0f;
      return std::abs(c.x - 0.5f) < 0.1f && std::abs(c.y - 0.5f) < 0.1f;
    });
  });
  const ProxyCheck hole = check(scene, pierced, 0.002);
  EXPECT_FALSE(hole.holds());
  // At the points of the hole itself the segment across passes, unless it is too oblique for its
  // way through the second face: more than half of 4 % of 20,000.
  EXPECT_GT(hole.leaks, 400u);
  EXPECT_LT(hole.leaks, 2000u);
  EXPECT_NE(hole.leak_from, hole.leak_to);
  const Scene blocked = withGeometry(scene, [](Geometry& g) {
    const auto first = static_cast<uint32_t>(g.positions.size());
    for (const Vec3f& p : {Vec3f(-2, -2, 0.3f), Vec3f(3, -2, 0.3f), Vec3f(0.5f, 4, 0.3f)})
      g.positions.push_back(p);
    g.triangles.push_back({{first, first + 1, first + 2}, 0});
  });
  EXPECT_GT(check(scene, blocked, 0.002).false_walls, 1000u);
}

// Distances along rays at an angle t to the normal differ by shift / cos t, with cos t uniform in
// [1/2, 1]: median shift / 0.75, at most twice the shift.
TEST(ProxyCheck, DistancesOfAShiftedSheet) {
  SceneBuilder builder;
  builder.quad(Vec3f(0), Vec3f(1, 0, 0), Vec3f(1, 1, 0), Vec3f(0, 1, 0),
               builder.material(Vec3f(0.5f)));
  const Scene scene = builder.finish();
  constexpr double kShift = 0.003;
  const Scene shifted = withGeometry(scene, [](Geometry& g) {
    for (Vec3f& p : g.positions) p.z -= static_cast<float>(kShift);
  });
  const ProxyCheck result = check(scene, shifted, kShift, 20000);
  EXPECT_EQ(result.leaks, 0u);
  EXPECT_GT(result.same_surface, 19000u);                      // all but those that pass the border
  EXPECT_NEAR(result.median_m, kShift / 0.75, 0.02 * kShift);  // 4 sigma of a median of 20,000
  EXPECT_LE(result.max_m, 2 * kShift + 1e-6);
  EXPECT_NEAR(result.p99_m, kShift / 0.505, 0.02 * kShift);
}

// A seam between two materials on a waving sheet: rays at points of the seam hit something in both.
TEST(ProxyCheck, TheSeamBetweenTwoMaterialsStaysTight) {
  SceneBuilder builder;
  const uint32_t a = builder.material(Vec3f(0.5f)), b = builder.material(Vec3f(0.2f));
  const auto wave = [](float x, float y) {
    return Vec3f(x, y, 0.003f * std::sin(20 * x) * std::cos(37 * y));
  };
  const int n = 24;
  addSheet(builder, n, a, wave);
  addSheet(builder, n, b, [&](float u, float v) { return wave(1 + u, v); });
  const Scene scene = builder.finish();
  RayProxyOptions options;
  options.max_edge_share = 1;
  options.max_error_m = 0.01;
  const RayProxy proxy = makeRayProxy(scene, options);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 4);
  const EmbreeScene before(scene), after(proxy.scene);
  uint32_t open_before = 0, open_after = 0;
  for (uint64_t i = 0; i < 50000; ++i) {
    Rng rng(i, RngStream::test);
    const float y = (0.02f + 0.96f * rng.nextFloat()) * n, low = std::floor(y);
    const Vec3f p0 = wave(1, low / n), p1 = wave(1, (low + 1) / n);
    const Vec3f target = p0 + (p1 - p0) * (y - low);  // on the seam's polyline
    const Vec3f from = target + Vec3f(rng.nextFloat() - 0.5f, 0.01f * rng.nextFloat(), 0.5f);
    const Ray ray{from, 0, normalize(target - from), kFarDistance};
    if (before.closest(ray).primitive == kNoHit) ++open_before;
    if (after.closest(ray).primitive == kNoHit) ++open_after;
  }
  EXPECT_EQ(open_before, 0u);
  EXPECT_EQ(open_after, 0u);
}

TEST(ProxyCheck, DegenerateScenesAreSurvived) {
  const Scene empty = SceneBuilder().finish();
  EXPECT_EQ(check(empty, empty, 0.01).blocked, 0u);
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  builder.triangle(Vec3f(0), Vec3f(1, 0, 0), Vec3f(2, 0, 0), m);
  const Scene line = builder.finish();
  EXPECT_EQ(check(line, line, 0.01).blocked, 0u);
  EXPECT_EQ(check(wavyWall(0.02f), empty, 0.002, 100).same_surface, 0u);
}

TEST(ProxyCheck, TheSameAgain) {
  const Scene scene = wavyWall(0.05f);
  RayProxyOptions options;
  options.max_edge_share = 1;
  options.max_error_m = 0.01;
  const RayProxy proxy = makeRayProxy(scene, options);
  const ProxyCheck a = check(scene, proxy.scene, 0.01, 2000);
  const ProxyCheck b = check(scene, proxy.scene, 0.01, 2000);
  EXPECT_EQ(a.blocked, b.blocked);
  EXPECT_EQ(a.free, b.free);
  EXPECT_EQ(a.max_m, b.max_m);
  EXPECT_EQ(a.median_m, b.median_m);
}

TEST(ProxyCheck, ShippedScenesHaveProxiesThatDoNotLeak) {
  for (const char* name :
       {"thin_wall/scene_01cm", "thin_wall/scene_20cm", "pillar_hall/scene", "mixed_scale/scene",
        "sphere_light/scene", "cornell/scene", "sealed_room/scene", "acute_corner/scene"}) {
    SCOPED_TRACE(name);
    const Scene scene = loadScene(std::string(PROBELAB_SOURCE_DIR) + "/scenes/" + name + ".toml");
    RayProxyOptions options;
    options.max_edge_share = 1;
    options.max_error_m = proxyErrorBound(0.01, wallOf(scene));
    const RayProxy proxy = makeRayProxy(scene, options);
    EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before);
    EXPECT_LE(proxy.report.proxy_to_original_m, options.max_error_m + 1e-6);
    const ProxyCheck result = check(scene, proxy.scene, options.max_error_m, 5000);
    EXPECT_EQ(result.leaks, 0u);
    EXPECT_EQ(result.lost, 0u);
    EXPECT_GT(result.blocked, 4000u);
  }
}

}  // namespace
}  // namespace probelab::test
