// SPDX-License-Identifier: GPL-3.0-or-later
// Textures seen through a ray's footprint: the shade stage against plain C++, the whole-sphere
// footprint against the mean, what stays at the base level, and what the switch is for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "base/rng.h"
#include "ddgi/constants.h"
#include "ddgi/directions.h"
#include "ddgi/ray_batch.h"
#include "gpu/shader.h"
#include "gpu_fixture.h"
#include "scene_builders.h"
#include "shared/light.h"

namespace probelab {
namespace {

using test::SceneBuilder;

Texture noiseTexture(int width, int height, uint64_t seed) {
  Rng rng(seed, RngStream::test);
  Texture texture;
  texture.width = width, texture.height = height;
  for (int i = 0; i < 4 * width * height; ++i)
    texture.rgba.push_back(static_cast<uint8_t>(rng.nextBelow(256)));
  return texture;
}

TextureUse useOf(int texture, TextureWrap wrap, std::array<float, 6> transform, int uv_set = 0) {
  TextureUse use;
  use.texture = texture;
  use.uv_set = uv_set;
  use.wrap_u = use.wrap_v = wrap;
  use.transform = transform;
  return use;
}

// A room of 3 x 3 x 3 m with noise on its walls: odd sizes, transforms, both uv sets, every wrap,
// metal, an emissive texture.
Scene noiseRoom(bool masked = false) {
  SceneBuilder builder;
  builder.scene().textures = {noiseTexture(64, 64, 1), noiseTexture(37, 20, 2),
                              noiseTexture(5, 128, 3)};
  Material a;
  a.base_color = Vec3f(0.9f, 0.8f, 0.7f);
  a.base_color_texture = useOf(0, TextureWrap::repeat, {3, 0.5f, 0.2f, -0.25f, 2, 0.1f});
  a.metallic = 0.8f;
  a.metallic_texture = useOf(0, TextureWrap::mirror, {1, 0, 0, 0, 1, 0}, 1);
  a.alpha_mask = masked;
  Material b;
  b.base_color_texture = useOf(1, TextureWrap::mirror, {2, 0, 0, 0, 2, 0}, 1);
  b.emission = Vec3f(2, 3, 4);
  b.emission_texture = useOf(2, TextureWrap::clamp, {1, 0, 0, 0, 1, 0});
  builder.box(Vec3f(0), Vec3f(3), builder.material(a), true);
  builder.box(Vec3f(1, 0.5f, 1), Vec3f(1.8f, 1.2f, 1.4f), builder.material(b), false);
  for (std::size_t i = 0; i < builder.geometry().positions.size(); ++i) {
    const Vec3f p = builder.geometry().positions[i];
    builder.geometry().uv0.push_back({0.4f * p.x + 0.3f * p.z, 0.5f * p.y + 0.2f * p.z});
    builder.geometry().uv1.push_back({0.7f * p.y - 0.3f * p.x, 0.6f * p.x + 0.9f * p.z});
  }
  return builder.finish();
}

std::vector<Ray> randomRays(const Vec3f& origin, int n, uint64_t seed) {
  std::vector<Ray> rays;
  for (const Vec3f& d : updateDirections(n, seed, 0)) rays.push_back({origin, 0, d, kFarDistance});
  return rays;
}

struct Traced {
  std::vector<Hit> hits;
  std::vector<RaySurface> surfaces;
};

class TextureLod : public GpuTest {
 protected:
  Traced trace(const Scene& scene, const std::vector<Ray>& rays, float footprint_rad,
               TextureDetail detail = TextureDetail::footprint,
               TracerKind tracer = TracerKind::embree) {
    const EmbreeScene embree(scene);
    const auto count = static_cast<uint32_t>(rays.size());
    RayBatch batch(gpu(), scene, embree, tracer, count, footprint_rad);
    StageRecorder recorder(gpu());
    batch.uploadRays(rays);
    batch.trace(recorder, count, detail);
    recorder.flush();
    return {downloadArray<Hit>(gpu(), batch.buffers().hits, count),
            downloadArray<RaySurface>(gpu(), batch.buffers().surfaces, count)};
  }
};

template <class T>
bool sameBytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

// The cone of solid angle 4 pi / R: a hemisphere for two rays, and pi spread^2 = 4 pi / R for many.
TEST(RaySpread, SharesTheSphereAmongTheRays) {
  EXPECT_FLOAT_EQ(raySpread(1), std::numbers::pi_v<float>);
  EXPECT_FLOAT_EQ(raySpread(2), 0.5f * std::numbers::pi_v<float>);
  EXPECT_NEAR(raySpread(10000), 0.02f, 1e-6f);
  for (const int rays : {3, 64, 144, 1024})
    EXPECT_NEAR(2 * std::numbers::pi * (1 - std::cos(static_cast<double>(raySpread(rays)))),
                4 * std::numbers::pi / rays, 1e-6);
}

TEST_F(TextureLod, WithoutAFootprintNothingChanges) {
  const Scene scene = noiseRoom();
  const std::vector<Ray> rays = randomRays(Vec3f(0.7f, 1.8f, 2.1f), 4000, 1);
  const Traced base = trace(scene, rays, 0, TextureDetail::base);
  EXPECT_TRUE(sameBytes(trace(scene, rays, 0).surfaces, base.surfaces));
  // Coarser levels in memory, rays that do not ask for them (a camera's).
  EXPECT_TRUE(sameBytes(trace(scene, rays, 0.3f, TextureDetail::base).surfaces, base.surfaces));
  EXPECT_FALSE(sameBytes(trace(scene, rays, 0.3f).surfaces, base.surfaces));
}

std::vector<uint32_t> compileShade(const char* level_of_detail) {
  SceneFeatures features;
  features.triangles = features.emission = features.textures = true;
  Defines defines = sceneDefines(features);
  int binding = 0;
  for (const char* input :
       {"RAYS", "HITS", "SURFACES", "TRIANGLES", "POSITIONS", "MATERIALS", "UV0", "UV1", "TEXELS"})
    defines.emplace_back(std::string("BIND_") + input, std::to_string(binding++));
  if (level_of_detail != nullptr) defines.emplace_back("PL_TEXTURE_LOD", level_of_detail);
  return compileShader({"ddgi/shade.comp.glsl", defines, {}});
}

// OpLoopMerge: the search for a level is a loop, the base lookup has none.
int loopsIn(const std::vector<uint32_t>& spirv) {
  constexpr uint32_t kOpLoopMerge = 246;
  int loops = 0;
  for (std::size_t i = 5; i < spirv.size(); i += spirv[i] >> 16)
    if ((spirv[i] & 0xffffu) == kOpLoopMerge) ++loops;
  return loops;
}

TEST(TextureLodShader, SwitchedOffItLeavesNoCode) {
  const std::vector<uint32_t> base = compileShade(nullptr);
  const std::vector<uint32_t> with = compileShade("1");
  EXPECT_EQ(base, compileShade("0"));
  EXPECT_GT(with.size(), base.size());
  EXPECT_EQ(loopsIn(with), loopsIn(base) + 3);  // base colour, metallic, emission
}

// ---- against plain C++ ----

float largestDifference(const Vec3f& a, const Vec3f& b) {
  return std::max({std::abs(a.x - b.x), std::abs(a.y - b.y), std::abs(a.z - b.z)});
}

struct Expected {
  Vec3f albedo, emission;
};

Expected expectedSurface(const Scene& scene, const MaterialTable& table, const Ray& ray,
                         const Hit& hit, float cone_area) {
  const Geometry& g = *scene.geometry;
  const Triangle& t = g.triangles[hit.primitive];
  const MaterialData& m = table.materials[t.material];
  const Vec3f p0 = g.positions[t.vertex[0]];
  const Vec3f area_vector = cross(g.positions[t.vertex[1]] - p0, g.positions[t.vertex[2]] - p0);
  const float footprint = footprintTriangles(cone_area, hit.t, area_vector, ray.direction);
  const auto lookup = [&](const TextureUseData& use, bool srgb) {
    const auto& all = textureUvSet(use.flags) == 0 ? g.uv0 : g.uv1;
    const Vec2f a = all[t.vertex[0]], b = all[t.vertex[1]], c = all[t.vertex[2]];
    const Vec2f ab = b - a, ac = c - a;
    const auto fetch = [&](uint32_t index) { return table.texels[index]; };
    return sampleFootprint(fetch, use, a * (1 - hit.u - hit.v) + b * hit.u + c * hit.v,
                           footprint * 0.5f * std::abs(ab.x * ac.y - ab.y * ac.x), srgb);
  };
  const auto color = [&](const TextureUseData& use) {
    if (use.width == 0) return Vec3f(1);
    const Vec4f x = lookup(use, true);
    return Vec3f(x.x, x.y, x.z);
  };
  const float metal = m.metallic_texture.width == 0 ? 1 : lookup(m.metallic_texture, false).z;
  return {m.base_color * color(m.base_color_texture) * (1 - m.metallic * metal),
          m.emission * color(m.emission_texture)};
}

// Coordinates differ by roundings of uv (|uv| < 8: 1e-6) times up to 128 texels, and the noise of
// neighbouring texels is up to 1: 1e-4; emission four times that. Where roundings (1e-6) put a ray
// on the other side between two levels it sees another one: of 3 x 4000 lookups 0.02.
TEST_F(TextureLod, TheShadeStageDoesWhatTheSharedTextDoes) {
  const Scene scene = noiseRoom();
  const MaterialTable table = makeMaterialTable(scene, TextureLevels::all);
  const std::vector<Ray> rays = randomRays(Vec3f(0.7f, 1.8f, 2.1f), 4000, 2);
  for (const float spread : {1e-4f, 0.02f, raySpread(1024), raySpread(64), 0.8f}) {
    const Traced traced = trace(scene, rays, spread);
    const float tangent = std::tan(spread);
    int front = 0, other_level = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      ASSERT_NE(traced.hits[i].primitive, kNoHit);
      const RaySurface& s = traced.surfaces[i];
      if (s.hit == 0) continue;
      ++front;
      const Expected e = expectedSurface(scene, table, rays[i], traced.hits[i],
                                         std::numbers::pi_v<float> * tangent * tangent);
      if (largestDifference(s.albedo, e.albedo) > 1e-4f ||
          largestDifference(s.radiance, e.emission) > 4e-4f)
        ++other_level;
    }
    EXPECT_LE(other_level, 1) << spread;
    EXPECT_EQ(front, 4000);
  }
}

double decode(double s) {  // IEC 61966-2-1
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}
double linearMean(const Texture& texture, std::size_t channel, bool srgb) {
  double sum = 0;
  for (std::size_t i = channel; i < texture.rgba.size(); i += 4)
    sum += srgb ? decode(texture.rgba[i] / 255.0) : texture.rgba[i] / 255.0;
  return sum / (texture.width * texture.height);
}

// 8 bits hold a colour within half a step; sRGB is at most 2.4 / 1.055 times as steep: 0.0045, of
// metal 0.002 of 0.8 of the base.
TEST_F(TextureLod, TheWholeSphereSeesTheMean) {
  const Scene scene = noiseRoom();
  const std::vector<Ray> rays = randomRays(Vec3f(0.7f, 1.8f, 2.1f), 1000, 3);
  for (const int ray_count : {1, 2}) {
    const Traced traced = trace(scene, rays, raySpread(ray_count));
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const uint32_t m = scene.geometry->triangles[traced.hits[i].primitive].material;
      const double metal = m == 0 ? 0.8 * linearMean(scene.textures[0], 2, false) : 0;
      for (std::size_t c = 0; c < 3; ++c) {
        const double base = static_cast<double>(scene.materials[m].base_color[c]) *
                            linearMean(scene.textures[m], c, true);
        ASSERT_NEAR(static_cast<double>(traced.surfaces[i].albedo[c]), base * (1 - metal), 0.006);
        const double emitted = static_cast<double>(scene.materials[m].emission[c]) *
                               linearMean(scene.textures[2], c, true);
        ASSERT_NEAR(static_cast<double>(traced.surfaces[i].radiance[c]), emitted, 4 * 0.0045);
      }
    }
  }
}

// ---- what stays at the base level ----

TEST_F(TextureLod, CutOutsKeepTheBaseLevel) {
  const Scene scene = noiseRoom(true);
  const std::vector<Ray> rays = randomRays(Vec3f(0.7f, 1.8f, 2.1f), 4000, 4);
  const Traced base = trace(scene, rays, 0);
  int holes = 0;
  for (const Hit& hit : base.hits) holes += hit.primitive == kNoHit ? 1 : 0;
  EXPECT_GT(holes, 500);  // alpha is uniform noise, half of it below the cutoff
  EXPECT_TRUE(sameBytes(trace(scene, rays, raySpread(64)).hits, base.hits));
  if (!gpu().info().ray_query) GTEST_SKIP() << "the device has no ray query";
  // Another tracer's rounding (1e-6 of uv, times 64 texels a unit) turns one of 1e4 lookups.
  for (const float footprint_rad : {0.0f, raySpread(64)}) {
    const Traced by_query =
        trace(scene, rays, footprint_rad, TextureDetail::footprint, TracerKind::rayquery);
    int different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i)
      different += by_query.hits[i].primitive != base.hits[i].primitive ? 1 : 0;
    EXPECT_LE(different, 8) << footprint_rad;
  }
}

// ---- what it is for ----

// A floor of 64 x 64 m, checks of 0.5 m, 1.5 m below the rays.
Scene checkeredFloor(bool nearest) {
  SceneBuilder builder;
  Texture texture;
  texture.width = texture.height = 64;
  for (int i = 0; i < 64 * 64; ++i)
    texture.rgba.insert(texture.rgba.end(), 4, (i / 64 + i) % 2 == 0 ? uint8_t{0} : uint8_t{255});
  builder.scene().textures = {texture};
  Material m;
  m.base_color_texture = useOf(0, TextureWrap::repeat, {2, 0, 0, 0, 2, 0});
  m.base_color_texture.nearest = nearest;
  const uint32_t floor = builder.material(m);
  builder.quad(Vec3f(-32, 0, 32), Vec3f(32, 0, 32), Vec3f(32, 0, -32), Vec3f(-32, 0, -32), floor);
  for (const Vec3f& p : builder.geometry().positions)
    builder.geometry().uv0.push_back({p.x / 64, p.z / 64});
  return builder.finish();
}

struct Moments {
  double mean = 0, variance = 0;
};

// Of the mean albedo that 64 rays see, over 500 random rotations of them.
Moments albedoOverRotations(const std::vector<RaySurface>& surfaces) {
  double sum = 0, squares = 0;
  constexpr int kUpdates = 500, kRays = 64;
  for (int update = 0; update < kUpdates; ++update) {
    double albedo = 0, hits = 0;
    for (int ray = 0; ray < kRays; ++ray) {
      const RaySurface& s = surfaces[static_cast<std::size_t>(update * kRays + ray)];
      if (s.hit == 0) continue;
      albedo += static_cast<double>(s.albedo.x), ++hits;
    }
    sum += albedo / hits, squares += albedo / hits * (albedo / hits);
  }
  const double mean = sum / kUpdates;
  return {mean, (squares / kUpdates - mean * mean) * kUpdates / (kUpdates - 1)};
}

TEST_F(TextureLod, ACheckeredFloorIsSeenWithLessNoiseAndTheSameMean) {
  std::vector<Ray> rays;
  for (uint64_t update = 0; update < 500; ++update)
    for (const Vec3f& d : updateDirections(64, 5, update))
      rays.push_back({Vec3f(0.1f, 1.5f, -0.07f), 0, d, kFarDistance});
  for (const bool nearest : {true, false}) {
    const Scene scene = checkeredFloor(nearest);
    const Moments base = albedoOverRotations(trace(scene, rays, 0).surfaces);
    const Moments wide = albedoOverRotations(trace(scene, rays, raySpread(64)).surfaces);
    RecordProperty(nearest ? "nearest" : "bilinear", std::to_string(wide.variance / base.variance));
    EXPECT_LT(wide.variance, 0.1 * base.variance);
    EXPECT_NEAR(wide.mean, base.mean, 4 * std::sqrt((base.variance + wide.variance) / 500));
    // Half the checks are white; 188 in 8 bits is 0.5029.
    EXPECT_NEAR(wide.mean, 0.5, 4 * std::sqrt(wide.variance / 500) + 0.0045);
  }
}

}  // namespace
}  // namespace probelab
