// SPDX-License-Identifier: GPL-3.0-or-later
// What decimated geometry keeps besides its shape: emitting area, textures and shading normals.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "ray_proxy_helpers.h"

namespace probelab::test {
namespace {

// A lamp with bumps: smoothing them away would cost a tenth of its area within the bound.
TEST(RayProxy, AnEmitterKeepsItsArea) {
  const auto bumps = [](float u, float v) {
    const float k = 37.699112f;  // 12 pi: the border is straight; slope up to 0.75
    return Vec3f(u, v, 0.02f * std::sin(k * u) * std::sin(k * v));
  };
  for (const bool emits : {false, true}) {
    SceneBuilder builder;
    addSheet(builder, 64, builder.material(Vec3f(0.5f), Vec3f(emits ? 1.0f : 0.0f)), bumps);
    const Scene scene = builder.finish();
    const RayProxy proxy = proxyOf(scene, 0.05);
    expectSound(scene, proxy);
    const double before = areaOf(*scene.geometry), after = areaOf(*proxy.scene.geometry);
    if (!emits) {
      EXPECT_LT(after, 0.97 * before);
      continue;
    }
    EXPECT_NEAR(after, before, 0.01 * before);
    EXPECT_NEAR(proxy.report.emitter_area_before_m2, before, 1e-5);
    EXPECT_NEAR(proxy.report.emitter_area_after_m2, after, 1e-5);
  }
}

Material textured() {
  Material m;
  m.base_color_texture.texture = 0;
  return m;
}

// Sheets in the plane z = 0 whose texture coordinates are a function of the place.
Scene texturedSheet(const std::function<Vec2f(const Vec3f&, int half)>& uv, bool seam) {
  SceneBuilder builder;
  builder.scene().textures.push_back({"t", 1, 1, {255, 255, 255, 255}});
  const uint32_t m = builder.material(textured());
  Geometry& g = builder.geometry();
  for (int half = 0; half < (seam ? 2 : 1); ++half) {
    addSheet(builder, 20, m,
             [&](float u, float v) { return Vec3f(static_cast<float>(half) + u, v, 0); });
    for (std::size_t i = g.uv0.size(); i < g.positions.size(); ++i)
      g.uv0.push_back(uv(g.positions[i], half));
  }
  return builder.finish();
}

Vec2d uvAt(const Geometry& g, std::size_t t, const Vec3d& w) {
  Vec2d uv;
  for (int k = 0; k < 3; ++k)
    uv += Vec2d(g.uv0[g.triangles[t].vertex[k]]) * w[static_cast<std::size_t>(k)];
  return uv;
}

TEST(RayProxy, AnEvenTextureStaysInPlaceOnBothSidesOfASeam) {
  const auto map = [](const Vec3f& p, int half) {
    return Vec2f(0.7f * p.x + 0.1f * p.y + 5 * static_cast<float>(half), 0.4f * p.y);
  };
  const Scene scene = texturedSheet(map, true);
  const RayProxy proxy = proxyOf(scene, 0.01);
  expectSound(scene, proxy);
  // 120 locked vertices around a polygon make 118 triangles; 19 more on the seam would add 38.
  EXPECT_LT(proxy.report.triangles_after, 118u + 38u);
  forPoints(*proxy.scene.geometry, [&](const Vec3d& p, std::size_t t, const Vec3d& w) {
    const Vec2d uv = uvAt(*proxy.scene.geometry, t, w);
    const double centre_x =
        (corner(*proxy.scene.geometry, t, 0).x + corner(*proxy.scene.geometry, t, 1).x +
         corner(*proxy.scene.geometry, t, 2).x) /
        3;
    const Vec2d truth(map(Vec3f(p), centre_x > 1 ? 1 : 0));
    EXPECT_NEAR(uv.x, truth.x, 1e-5);
    EXPECT_NEAR(uv.y, truth.y, 1e-5);
  });
}

// The texture is torn along x = 1/2 above y = 1/2 and whole below: the tear ends inside.
TEST(RayProxy, ATextureSeamMayEndInside) {
  SceneBuilder builder;
  builder.scene().textures.push_back({"t", 1, 1, {255, 255, 255, 255}});
  const uint32_t m = builder.material(textured());
  Geometry& g = builder.geometry();
  const auto map = [](double x, double y, bool right) {
    return Vec2d(x, y + (right ? std::max(0.0, y - 0.5) : 0.0));
  };
  for (const bool right : {false, true}) {
    addSheet(builder, 20, m,
             [&](float u, float v) { return Vec3f(0.5f * u + (right ? 0.5f : 0.0f), v, 0); });
    for (std::size_t i = g.uv0.size(); i < g.positions.size(); ++i)
      g.uv0.push_back(Vec2f(map(g.positions[i].x, g.positions[i].y, right)));
  }
  const RayProxy proxy = proxyOf(builder.finish(), 0.01);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 3);
  const Geometry& after = *proxy.scene.geometry;
  forPoints(after, [&](const Vec3d& p, std::size_t t, const Vec3d& w) {
    const bool right = corner(after, t, 0).x + corner(after, t, 1).x + corner(after, t, 2).x > 1.5;
    const Vec2d uv = uvAt(after, t, w), truth = map(p.x, p.y, right);
    EXPECT_NEAR(uv.x, truth.x, 0.01 + 1e-5);
    EXPECT_NEAR(uv.y, truth.y, 2 * 0.01 + 1e-5);  // up to 2 of v a metre
  });
}

TEST(RayProxy, AStretchedTextureMovesByTheBoundAtMost) {
  constexpr double kBound = 0.01;
  const Scene scene =
      texturedSheet([](const Vec3f& p, int) { return Vec2f(p.x + 0.5f * p.x * p.x, p.y); }, false);
  const RayProxy proxy = proxyOf(scene, kBound);
  expectSound(scene, proxy);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before);
  // u = x + x^2 / 2, so a texel belongs at x = sqrt(1 + 2 u) - 1. Linear interpolation over a cell
  // of 1/20 errs by (1/20)^2 / 8 itself; checked at vertices that went, so twice the bound between.
  forPoints(*proxy.scene.geometry, [&](const Vec3d& p, std::size_t t, const Vec3d& w) {
    const Vec2d uv = uvAt(*proxy.scene.geometry, t, w);
    EXPECT_NEAR(std::sqrt(1 + 2 * uv.x) - 1, p.x, kBound + 1.0 / 3200 + 1e-5);
    EXPECT_NEAR(uv.y, p.y, kBound + 1e-5);
  });
}

// The rounded edge of a board: flattening it would lie within the bound, but its normals would then
// spread over the whole face.
TEST(RayProxy, ShadingNormalsTurnByTheirBoundAtMost) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  const float radius = 0.003f;
  const auto profile =
      [&](float s) {  // a quarter circle between two faces; normal = (x, z) - centre
        const float angle = 1.5707964f * std::clamp((s - 0.4f) / 0.2f, 0.0f, 1.0f);
        const Vec3f normal(std::sin(angle), 0, std::cos(angle));
        Vec3f p = normal * radius;
        p.x -= std::max(0.4f - s, 0.0f) * 2.5f, p.z -= std::max(s - 0.6f, 0.0f) * 2.5f;
        return std::pair(p, normal);
      };
  constexpr int kAlong = 20, kAround = 40;
  for (int i = 0; i <= kAround; ++i)
    for (int j = 0; j <= kAlong; ++j) {
      auto [p, normal] = profile(static_cast<float>(i) / kAround);
      p.y = static_cast<float>(j) / kAlong;
      builder.vertex(p);
      builder.geometry().normals.push_back(normal);
    }
  for (uint32_t i = 0; i < kAround; ++i)
    for (uint32_t j = 0; j < kAlong; ++j) {
      const uint32_t a = i * (kAlong + 1) + j, b = a + kAlong + 1;
      builder.geometry().triangles.push_back({{a, b, b + 1}, m});
      builder.geometry().triangles.push_back({{a, b + 1, a + 1}, m});
    }
  const Scene scene = builder.finish();
  const RayProxy proxy = proxyOf(scene, 0.004);
  expectSound(scene, proxy);
  EXPECT_LT(proxy.report.triangles_after, proxy.report.triangles_before / 2);
  const Geometry& g = *proxy.scene.geometry;
  double flat_area = 0, wrong_area = 0;
  for (std::size_t t = 0; t < g.triangles.size(); ++t) {
    const double area = length(areaVector(g, t));
    const bool on_face =
        std::abs(areaVector(g, t).z) > 0.999 * area || std::abs(areaVector(g, t).x) > 0.999 * area;
    if (!on_face) continue;
    flat_area += area;
    Vec3d normal;
    for (int k = 0; k < 3; ++k) normal += Vec3d(g.normals[g.triangles[t].vertex[k]]);
    if (dot(normalize(normal), areaVector(g, t) / area) < std::cos(0.2618)) wrong_area += area;
  }
  EXPECT_GT(flat_area, 1.9);  // two faces of 1 m by 1 m
  EXPECT_LT(wrong_area, 0.01 * flat_area);
}

}  // namespace
}  // namespace probelab::test
