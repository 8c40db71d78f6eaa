// SPDX-License-Identifier: GPL-3.0-or-later
// The coarser levels of textures and the lookup over a footprint, against means computed here.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "base/rng.h"
#include "scene_builders.h"
#include "trace/surface.h"

namespace probelab::test {
namespace {

Texture noiseTexture(int width, int height, uint64_t seed) {
  Rng rng(seed, RngStream::test);
  Texture texture;
  texture.width = width, texture.height = height;
  for (int i = 0; i < 4 * width * height; ++i)
    texture.rgba.push_back(static_cast<uint8_t>(rng.nextBelow(256)));
  return texture;
}

// One material whose base colour shows the texture.
Scene colorScene(const Texture& texture, TextureWrap wrap = TextureWrap::repeat,
                 bool nearest = false) {
  SceneBuilder builder;
  builder.scene().textures = {texture};
  Material m;
  m.base_color_texture.texture = 0;
  m.base_color_texture.wrap_u = m.base_color_texture.wrap_v = wrap;
  m.base_color_texture.nearest = nearest;
  builder.material(m);
  return builder.finish();
}

Scene metallicScene(const Texture& texture) {
  Scene scene = colorScene(texture);
  std::swap(scene.materials[0].base_color_texture, scene.materials[0].metallic_texture);
  return scene;
}

Vec4f sample(const MaterialTable& table, const TextureUseData& use, const Vec2f& uv, float uv_area,
             bool srgb = true) {
  const auto fetch = [&](uint32_t index) { return table.texels[index]; };
  return sampleFootprint(fetch, use, uv, uv_area, srgb);
}
Vec4f sampleLevel(const MaterialTable& table, const TextureUseData& use, const Vec2f& uv) {
  const auto fetch = [&](uint32_t index) { return table.texels[index]; };
  return sampleTexture(fetch, use, uv, true);
}

TextureUseData coarsest(TextureUseData use) {
  while (use.width * use.height > 1) use = coarserLevel(use);
  return use;
}

int channel(uint32_t texel, int c) { return static_cast<int>((texel >> (8 * c)) & 255u); }

double decode(double s) {  // IEC 61966-2-1
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}
double encode(double x) {
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

// Mean of channel c over a whole texture, in units of 1 / 255; colours through linear light.
double meanByte(const Texture& texture, int c, bool srgb) {
  double sum = 0;
  for (std::size_t i = static_cast<std::size_t>(c); i < texture.rgba.size(); i += 4)
    sum += srgb ? decode(texture.rgba[i] / 255.0) : texture.rgba[i] / 255.0;
  const double mean = sum / (texture.width * texture.height);
  return 255 * (srgb ? encode(mean) : mean);
}

constexpr std::array<std::array<int, 2>, 9> kSizes = {
    {{1, 1}, {2, 2}, {64, 64}, {3, 3}, {5, 7}, {100, 37}, {1, 9}, {16, 1}, {31, 64}}};

// Half a step of rounding, and 0.01 for the fp32 sums (relative error below 1e-6 a level).
TEST(TextureLevels, TheCoarsestIsTheMeanInLinearLightForEverySize) {
  for (const auto& [width, height] : kSizes) {
    const Texture texture = noiseTexture(width, height, static_cast<uint64_t>(width + height));
    for (const bool srgb : {true, false}) {
      const MaterialTable table = makeMaterialTable(
          srgb ? colorScene(texture) : metallicScene(texture), TextureLevels::all);
      const MaterialData& m = table.materials[0];
      const uint32_t texel =
          table.texels[coarsest(srgb ? m.base_color_texture : m.metallic_texture).first_texel];
      for (int c = 0; c < 4; ++c)
        EXPECT_NEAR(channel(texel, c), meanByte(texture, c, srgb && c < 3), 0.51)
            << width << " x " << height << " channel " << c << " srgb " << srgb;
    }
  }
}

TEST(TextureLevels, OddSizesShareTheirTexelsByArea) {
  Texture texture;
  texture.width = 5, texture.height = 1;
  for (const int v : {10, 50, 90, 200, 240})
    texture.rgba.insert(texture.rgba.end(), {0, 0, static_cast<uint8_t>(v), 255});
  const MaterialTable table = makeMaterialTable(metallicScene(texture), TextureLevels::all);
  ASSERT_EQ(table.texels.size(), 5u + 2u + 1u);
  EXPECT_EQ(channel(table.texels[5], 2), 42);   // (10 + 50 + 90 / 2) / 2.5
  EXPECT_EQ(channel(table.texels[6], 2), 194);  // (90 / 2 + 200 + 240) / 2.5
  EXPECT_EQ(channel(table.texels[7], 2), 118);  // 590 / 5
}

// Each texel is rounded by at most half a step, so is the mean of a level.
TEST(TextureLevels, EveryLevelHasTheMeanOfTheTexture) {
  for (const auto& [width, height] : kSizes) {
    const Texture texture = noiseTexture(width, height, 7);
    const MaterialTable table = makeMaterialTable(metallicScene(texture), TextureLevels::all);
    TextureUseData use = table.materials[0].metallic_texture;
    for (; use.width * use.height > 1; use = coarserLevel(use)) {
      double sum = 0;
      for (uint32_t i = 0; i < use.width * use.height; ++i)
        sum += channel(table.texels[use.first_texel + i], 2);
      EXPECT_NEAR(sum / (use.width * use.height), meanByte(texture, 2, false), 0.51)
          << width << " x " << height << " at " << use.width << " x " << use.height;
    }
  }
}

TEST(TextureLevels, AUniformTextureStaysWhatItIs) {
  for (int v = 0; v < 256; ++v) {
    Texture texture;
    texture.width = 7, texture.height = 6;
    texture.rgba.assign(4 * 7 * 6, static_cast<uint8_t>(v));
    for (const Scene& scene : {colorScene(texture), metallicScene(texture)})
      for (const uint32_t texel : makeMaterialTable(scene, TextureLevels::all).texels)
        ASSERT_EQ(texel, static_cast<uint32_t>(v) * 0x01010101u);
  }
}

TEST(TextureLevels, TheBaseTableHoldsTheTexturesAsTheyAre) {
  const Texture texture = noiseTexture(6, 5, 3);
  const MaterialTable base = makeMaterialTable(colorScene(texture));
  const MaterialTable all = makeMaterialTable(colorScene(texture), TextureLevels::all);
  ASSERT_EQ(base.texels.size(), 30u);
  ASSERT_EQ(all.texels.size(), 30u + 3 * 2 + 1);
  for (std::size_t i = 0; i < 30; ++i) {
    for (int c = 0; c < 4; ++c)
      EXPECT_EQ(channel(base.texels[i], c), texture.rgba[4 * i + static_cast<std::size_t>(c)]);
    EXPECT_EQ(all.texels[i], base.texels[i]);
  }
}

TEST(TextureLevels, ATextureThatIsColourAndMetallicHasBothMeans) {
  Scene scene = colorScene(noiseTexture(8, 8, 5));
  scene.textures.insert(scene.textures.begin(), noiseTexture(2, 2, 6));  // nobody uses it
  scene.materials[0].base_color_texture.texture = 1;
  scene.materials[0].metallic_texture = scene.materials[0].base_color_texture;
  const MaterialTable table = makeMaterialTable(scene, TextureLevels::all);
  EXPECT_EQ(table.texels.size(), 4u + 2 * 85);
  const MaterialData& m = table.materials[0];
  const Texture& texture = scene.textures[1];
  EXPECT_NEAR(channel(table.texels[coarsest(m.base_color_texture).first_texel], 2),
              meanByte(texture, 2, true), 0.51);
  EXPECT_NEAR(channel(table.texels[coarsest(m.metallic_texture).first_texel], 2),
              meanByte(texture, 2, false), 0.51);
}

TEST(SampleFootprint, UpToOneTexelItIsTheBaseLevelToTheBit) {
  Rng rng(11, RngStream::test);
  for (const bool nearest : {false, true}) {
    const MaterialTable table = makeMaterialTable(
        colorScene(noiseTexture(16, 8, 1), TextureWrap::mirror, nearest), TextureLevels::all);
    const TextureUseData& use = table.materials[0].base_color_texture;
    for (int i = 0; i < 200; ++i) {
      const Vec2f uv(4 * rng.nextFloat() - 2, 4 * rng.nextFloat() - 2);
      for (const float area : {0.0f, 1e-9f, 1.0f / 128})
        EXPECT_EQ(sample(table, use, uv, area), sampleLevel(table, use, uv));
    }
  }
}

TEST(SampleFootprint, AFootprintAsLargeAsTheTextureGivesItsMean) {
  Rng rng(12, RngStream::test);
  for (const TextureWrap wrap : {TextureWrap::repeat, TextureWrap::clamp, TextureWrap::mirror})
    for (const auto& [width, height] : kSizes) {
      const Texture texture = noiseTexture(width, height, 2);
      const MaterialTable table = makeMaterialTable(colorScene(texture, wrap), TextureLevels::all);
      const TextureUseData& use = table.materials[0].base_color_texture;
      for (const float area : {1.0f, 5.0f, 1e30f}) {
        const Vec4f t = sample(table, use, Vec2f(rng.nextFloat(), rng.nextFloat()), area);
        EXPECT_NEAR(255 * encode(static_cast<double>(t.x)), meanByte(texture, 0, true), 0.51);
        EXPECT_NEAR(255 * static_cast<double>(t.w), meanByte(texture, 3, false), 0.51);
      }
    }
}

TEST(SampleFootprint, FootprintsOfALevelsTexelReadThatLevelAlone) {
  // 1 / (width height) is exact for powers of two only.
  for (const auto& size : {Vec2f(64, 64), Vec2f(256, 1), Vec2f(32, 8)}) {
    const MaterialTable table = makeMaterialTable(
        colorScene(noiseTexture(static_cast<int>(size.x), static_cast<int>(size.y), 4)),
        TextureLevels::all);
    TextureUseData level = table.materials[0].base_color_texture;
    for (; level.width * level.height > 1; level = coarserLevel(level)) {
      const float area = 1 / static_cast<float>(level.width * level.height);
      const Vec2f uv(0.37f, 0.61f);
      EXPECT_EQ(sample(table, table.materials[0].base_color_texture, uv, area),
                sampleLevel(table, level, uv))
          << level.width << " x " << level.height;
    }
  }
}

TEST(SampleFootprint, CoarseLevelsWrapAsTheBaseDoes) {
  Texture texture;  // 4 x 2: left half black, right half white
  texture.width = 4, texture.height = 2;
  for (int i = 0; i < 8; ++i)
    texture.rgba.insert(texture.rgba.end(), 4, static_cast<uint8_t>(i % 4 < 2 ? 0 : 255));
  const auto red = [&](TextureWrap wrap) {  // of the 2 x 1 level, at its left edge
    const MaterialTable table = makeMaterialTable(colorScene(texture, wrap), TextureLevels::all);
    return sample(table, table.materials[0].base_color_texture, Vec2f(0, 0.5f), 0.5f).x;
  };
  EXPECT_NEAR(red(TextureWrap::repeat), 0.5f, 1e-6f);
  EXPECT_EQ(red(TextureWrap::clamp), 0);
  EXPECT_EQ(red(TextureWrap::mirror), 0);
}

TEST(SampleFootprint, TheTransformScalesTheArea) {
  const MaterialTable table =
      makeMaterialTable(colorScene(noiseTexture(64, 64, 9)), TextureLevels::all);
  const TextureUseData plain = table.materials[0].base_color_texture;
  TextureUseData scaled = plain;  // turned, mirrored, 2 x 4 times as dense
  scaled.m00 = 0, scaled.m01 = 2, scaled.m10 = 4, scaled.m11 = 0;
  for (const float area : {1e-4f, 1e-3f, 0.01f, 0.1f})
    EXPECT_EQ(sample(table, scaled, Vec2f(0.1f, 0.05f), area),
              sample(table, plain, Vec2f(0.1f, 0.4f), 8 * area));
}

// Noise averaged over 4^l texels has 4^-l of the variance, and a footprint of k texels reads the
// nearest l. n = 65536 / 4^l independent values give a variance within sqrt(2 / n); four of that.
TEST(SampleFootprint, NoiseFallsWithTheFootprintsArea) {
  const Texture texture = noiseTexture(256, 256, 10);
  const Scene scene = colorScene(texture, TextureWrap::repeat, true);
  const MaterialTable table = makeMaterialTable(scene, TextureLevels::all);
  const TextureUseData& use = table.materials[0].base_color_texture;
  const auto variance = [&](float texels) {
    double sum = 0, squares = 0;
    for (int i = 0; i < 65536; ++i) {
      const Vec2f uv((static_cast<float>(i % 256) + 0.5f) / 256,
                     (static_cast<float>(i / 256) + 0.5f) / 256);
      const double x = static_cast<double>(sample(table, use, uv, texels / 65536).w);
      sum += x, squares += x * x;
    }
    return squares / 65536 - sum * sum / 65536 / 65536;
  };
  const double base = variance(1);
  for (const auto& [texels, mean_of] :
       {std::pair(1.9f, 1), std::pair(2.1f, 4), std::pair(4.0f, 4), std::pair(7.9f, 4),
        std::pair(8.1f, 16), std::pair(31.0f, 16), std::pair(33.0f, 64)})
    EXPECT_NEAR(variance(texels) * mean_of / base, 1, 4 * std::sqrt(2.0 * mean_of / 65536))
        << texels;
}

// A right triangle with legs 2 m, area 2 m^2, seen from 3 m under 60 degrees: the disc of a cone
// with cone_area 0.1 has 0.1 x 9, twice that on the tilted plane.
TEST(FootprintTriangles, IsTheFootprintsAreaOverTheTriangles) {
  const Vec3f area_vector(0, 0, 4);
  const Vec3f direction(std::sqrt(0.75f), 0, -0.5f);
  EXPECT_NEAR(footprintTriangles(0.1f, 3, area_vector, direction), 0.9f * 2 / 2, 1e-6f);
  EXPECT_NEAR(footprintTriangles(0.1f, 3, area_vector, -direction), 0.9f * 2 / 2, 1e-6f);
  // Free of scale: 128 times the lengths.
  EXPECT_EQ(footprintTriangles(0.1f, 3 * 128, area_vector * (128.0f * 128.0f), direction),
            footprintTriangles(0.1f, 3, area_vector, direction));
  EXPECT_EQ(footprintTriangles(0, 3, area_vector, direction), 0);
  // Seen edge on: huge, but a number.
  EXPECT_GT(footprintTriangles(0.1f, 3, area_vector, Vec3f(1, 0, 0)), 1e20f);
  EXPECT_TRUE(std::isfinite(footprintTriangles(0.1f, 3, area_vector, Vec3f(1, 0, 0))));
}

}  // namespace
}  // namespace probelab::test
