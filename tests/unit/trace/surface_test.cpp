// SPDX-License-Identifier: GPL-3.0-or-later
// Surface rules and the lookups that the shade stage shares (lights, textures).
#include "trace/surface.h"

#include <gtest/gtest.h>

#include "scene_builders.h"
#include "shared/light.h"
#include "trace/embree_scene.h"

namespace probelab::test {
namespace {

Surface hitFrom(const Scene& scene, const Vec3f& origin, const Vec3f& direction) {
  const EmbreeScene embree(scene);
  const Hit hit = embree.closest(Ray{origin, 0, direction, kFarDistance});
  EXPECT_NE(hit.primitive, kNoHit);
  return surfaceAt(*scene.geometry, makeMaterialTable(scene), hit, direction);
}

SceneBuilder quadFacingZ(const Material& material) {
  SceneBuilder builder;
  const uint32_t m = builder.material(material);
  builder.quad(Vec3f(0), Vec3f(1, 0, 0), Vec3f(1, 1, 0), Vec3f(0, 1, 0), m);
  return builder;
}

Material glowing() {
  Material m;
  m.base_color = Vec3f(0.8f, 0.4f, 0.2f);
  m.emission = Vec3f(3, 2, 1);
  return m;
}

TEST(Surface, FrontOfASingleSidedMaterial) {
  const Scene scene = quadFacingZ(glowing()).finish();
  const Surface s = hitFrom(scene, Vec3f(0.3f, 0.6f, 2), Vec3f(0, 0, -1));
  EXPECT_FALSE(s.is_black_backface);
  EXPECT_EQ(s.geometric_normal, Vec3f(0, 0, 1));
  EXPECT_EQ(s.shading_normal, Vec3f(0, 0, 1));
  EXPECT_EQ(s.albedo, Vec3f(0.8f, 0.4f, 0.2f));
  EXPECT_EQ(s.emission, Vec3f(3, 2, 1));
  EXPECT_NEAR(s.point.position.x, 0.3f, 1e-6f);
  EXPECT_NEAR(s.point.position.y, 0.6f, 1e-6f);
}

TEST(Surface, BackOfASingleSidedMaterialIsBlackAndDoesNotEmit) {
  const Surface s = hitFrom(quadFacingZ(glowing()).finish(), Vec3f(0.3f, 0.6f, -2), Vec3f(0, 0, 1));
  EXPECT_TRUE(s.is_black_backface);
  EXPECT_EQ(s.albedo, Vec3f(0));
  EXPECT_EQ(s.emission, Vec3f(0));
}

TEST(Surface, DoubleSidedFlipsTheNormalToTheSideThatWasHit) {
  Material m = glowing();
  m.double_sided = true;
  const Surface s = hitFrom(quadFacingZ(m).finish(), Vec3f(0.3f, 0.6f, -2), Vec3f(0, 0, 1));
  EXPECT_FALSE(s.is_black_backface);
  EXPECT_EQ(s.geometric_normal, Vec3f(0, 0, -1));
  EXPECT_EQ(s.emission, Vec3f(3, 2, 1));
}

TEST(Surface, MetalHasLessAlbedo) {
  Material m = glowing();
  m.metallic = 0.75f;
  const Surface s = hitFrom(quadFacingZ(m).finish(), Vec3f(0.3f, 0.6f, 2), Vec3f(0, 0, -1));
  EXPECT_NEAR(s.albedo.x, 0.2f, 1e-6f);
}

TEST(Surface, ShadingNormalsAreInterpolatedAndKeptOnTheGeometricSide) {
  SceneBuilder builder = quadFacingZ(glowing());
  const Vec3f tilted = normalize(Vec3f(1, 0, 1));
  builder.geometry().normals.assign(builder.geometry().positions.size(), -tilted);
  const Surface s = hitFrom(builder.finish(), Vec3f(0.3f, 0.6f, 2), Vec3f(0, 0, -1));
  EXPECT_NEAR(s.shading_normal.x, tilted.x, 1e-6f);
  EXPECT_NEAR(s.shading_normal.z, tilted.z, 1e-6f);
  EXPECT_EQ(s.geometric_normal, Vec3f(0, 0, 1));
}

TEST(Surface, ZeroVertexNormalsMeanTheFacesOwn) {
  SceneBuilder builder = quadFacingZ(glowing());
  builder.geometry().normals.assign(builder.geometry().positions.size(), Vec3f());
  const Surface s = hitFrom(builder.finish(), Vec3f(0.3f, 0.6f, 2), Vec3f(0, 0, -1));
  EXPECT_EQ(s.shading_normal, Vec3f(0, 0, 1));
}

Scene texturedQuad(TextureWrap wrap, bool nearest, bool metallic = false) {
  Material m;
  TextureUse use;
  use.texture = 1;
  use.wrap_u = use.wrap_v = wrap;
  use.nearest = nearest;
  use.transform = {2, 0, 0, 0, 2, 0};  // the quad shows uv 0 .. 2
  if (metallic) {
    m.metallic = 1;
    m.metallic_texture = use;
  } else {
    m.base_color_texture = use;
  }
  SceneBuilder builder = quadFacingZ(m);
  Texture other;
  other.width = other.height = 1;
  other.rgba = {9, 9, 9, 9};
  Texture texture;
  texture.width = 2, texture.height = 1;
  texture.rgba = {188, 0, 64, 255, 0, 255, 128, 255};
  builder.scene().textures = {other, texture};
  for (const Vec3f& p : builder.geometry().positions) builder.geometry().uv0.push_back({p.x, p.y});
  return builder.finish();
}

Vec3f albedoAt(const Scene& scene, float x) {
  return hitFrom(scene, Vec3f(x, 0.3f, 1), Vec3f(0, 0, -1)).albedo;
}

// sRGB 188 is 0.50289 in linear light (IEC 61966-2-1).
TEST(Textures, DecodeBeforeTheyFilter) {
  const Scene scene = texturedQuad(TextureWrap::repeat, false);
  EXPECT_NEAR(albedoAt(scene, 0.125f).x, 0.502886f, 2e-5f);  // centre of the first texel
  EXPECT_NEAR(albedoAt(scene, 0.25f).x, 0.5f * 0.502886f, 2e-5f);
  EXPECT_NEAR(albedoAt(scene, 0.25f).y, 0.5f, 2e-5f);
}

TEST(Textures, Wrap) {
  // u = 2 x: the second half of the quad shows the second period.
  const Scene repeat = texturedQuad(TextureWrap::repeat, true);
  const Scene mirror = texturedQuad(TextureWrap::mirror, true);
  const Scene clamped = texturedQuad(TextureWrap::clamp, true);
  EXPECT_EQ(albedoAt(repeat, 0.6f).y, 0);
  EXPECT_EQ(albedoAt(mirror, 0.6f).y, 1);
  EXPECT_EQ(albedoAt(mirror, 0.9f).y, 0);
  EXPECT_EQ(albedoAt(clamped, 0.9f).y, 1);
}

TEST(Textures, BilinearNeighboursWrapToo) {
  // At u = 0 the neighbours are the last and the first texel, or twice the first.
  EXPECT_NEAR(albedoAt(texturedQuad(TextureWrap::repeat, false), 0.0001f).y, 0.5f, 1e-3f);
  EXPECT_NEAR(albedoAt(texturedQuad(TextureWrap::mirror, false), 0.0001f).y, 0.0f, 1e-3f);
  EXPECT_NEAR(albedoAt(texturedQuad(TextureWrap::clamp, false), 0.0001f).y, 0.0f, 1e-3f);
}

TEST(Textures, MetallicIsLinearBlue) {
  const Scene scene = texturedQuad(TextureWrap::repeat, true, true);
  EXPECT_NEAR(albedoAt(scene, 0.1f).x, 1 - 64 / 255.0f, 1e-6f);
}

TEST(Textures, SrgbIsWithinRoundingOfTheStandard) {
  for (int i = 0; i < 256; ++i) {
    const double s = i / 255.0;
    const double truth = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
    // Ten fp32 operations, half a unit each: 6e-7.
    EXPECT_NEAR(srgbByte(static_cast<uint32_t>(i)), truth, 6e-7 * truth);
  }
}

LightData light(uint32_t type) {
  LightData l{};
  l.type = type;
  l.intensity = Vec3f(8);
  l.position = Vec3f(0, 2, 0);
  l.direction = Vec3f(0, -1, 0);
  return l;
}

TEST(Lights, PointFallsWithTheSquareOfTheDistance) {
  const LightSample s = sampleLight(light(kLightPoint), Vec3f(0));
  EXPECT_FLOAT_EQ(s.irradiance.x, 2);
  EXPECT_EQ(s.direction, Vec3f(0, 1, 0));
  EXPECT_LT(s.t_max, 2);
  EXPECT_GT(s.t_max, 1.9999f);
}

TEST(Lights, RangeWindow) {
  LightData l = light(kLightPoint);
  l.range = 4;  // 1 - (2/4)^4
  EXPECT_FLOAT_EQ(sampleLight(l, Vec3f(0)).irradiance.x, 2 * (1 - 1.0f / 16));
  EXPECT_EQ(sampleLight(l, Vec3f(0, -2, 0)).irradiance.x, 0);
  EXPECT_EQ(sampleLight(l, Vec3f(0, -3, 0)).irradiance.x, 0);
}

TEST(Lights, SpotIsFullInsideAndBlackOutsideItsCones) {
  LightData l = light(kLightSpot);
  l.cos_inner = 0.9f, l.cos_outer = 0.7f;
  EXPECT_FLOAT_EQ(sampleLight(l, Vec3f(0)).irradiance.x, 2);
  // 45 degrees off the axis: cosine 0.70711, ((0.70711 - 0.7) / 0.2)^2 of 8 / 8.
  const double factor = std::pow((std::sqrt(0.5) - 0.7) / 0.2, 2);
  EXPECT_NEAR(sampleLight(l, Vec3f(2, 0, 0)).irradiance.x, factor, 1e-5);
  EXPECT_EQ(sampleLight(l, Vec3f(2.1f, 0, 0)).irradiance.x, 0);
}

TEST(Lights, DirectionalIsLuxFromFiniteDistance) {
  const LightSample s = sampleLight(light(kLightDirectional), Vec3f(5));
  EXPECT_FLOAT_EQ(s.irradiance.x, 8);
  EXPECT_EQ(s.direction, Vec3f(0, 1, 0));
  EXPECT_TRUE(std::isfinite(s.t_max));
}

TEST(Lights, AtTheLightItselfNothingIsNotFinite) {
  const LightSample s = sampleLight(light(kLightPoint), Vec3f(0, 2, 0));
  EXPECT_EQ(s.irradiance, Vec3f(0));
  EXPECT_TRUE(isFinite(sampleLight(light(kLightPoint), Vec3f(0, 2.0001f, 0)).irradiance));
}

}  // namespace
}  // namespace probelab::test
