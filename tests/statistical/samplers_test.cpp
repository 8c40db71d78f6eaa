// SPDX-License-Identifier: GPL-3.0-or-later
// Every sampler against its density (chi-square over the sphere), and the halves of an estimate
// against each other.
#include <gtest/gtest.h>

#include <functional>

#include "base/rng.h"
#include "scene_builders.h"
#include "statistical/z_test.h"
#include "trace/light_sampling.h"
#include "trace/sampler.h"
#include "trace/sampling.h"

namespace probelab::test {
namespace {

constexpr int kRows = 20, kColumns = 40;  // bins in cos theta and phi: equal solid angles
constexpr uint64_t kSamples = 400000;
constexpr double kLevel = kFamilyLevel / 8;  // the tests of this file

int binOf(const Vec3f& d) {
  const double v = 0.5 - 0.5 * static_cast<double>(d.y);
  const double u =
      0.5 + std::atan2(static_cast<double>(d.x), static_cast<double>(d.z)) / (2 * M_PI);
  return std::min(kRows - 1, static_cast<int>(v * kRows)) * kColumns +
         std::min(kColumns - 1, static_cast<int>(u * kColumns));
}

// Counts of directions from `sample` against the integral of `density` over each bin (midpoint rule
// on `fine` x `fine` points); a sample without a direction returns false.
void expectDensity(const std::function<bool(const Vec2f&, float, Vec3f&)>& sample,
                   const std::function<double(const Vec3f&)>& density, int fine = 40) {
  std::vector<uint64_t> counts(kRows * kColumns);
  uint64_t kept = 0;
  Rng rng(1, RngStream::test);
  for (uint64_t i = 0; i < kSamples; ++i) {
    const float a = rng.nextFloat(), b = rng.nextFloat(), c = rng.nextFloat();
    Vec3f d;
    if (!sample({a, b}, c, d)) continue;
    EXPECT_NEAR(length(d), 1, 1e-4);
    ++counts[static_cast<std::size_t>(binOf(d))], ++kept;
  }
  std::vector<double> expected(counts.size());
  double total = 0;
  for (int y = 0; y < kRows * fine; ++y)
    for (int x = 0; x < kColumns * fine; ++x) {
      const double c = 1 - 2 * (y + 0.5) / (kRows * fine);
      const double phi = 2 * M_PI * ((x + 0.5) / (kColumns * fine) - 0.5);
      const double r = std::sqrt(1 - c * c);
      const double share = density(Vec3f(Vec3d(r * std::sin(phi), c, r * std::cos(phi)))) * 4 *
                           M_PI / (kRows * fine * kColumns * fine);
      expected[static_cast<std::size_t>(y / fine * kColumns + x / fine)] +=
          share * static_cast<double>(kSamples);
      total += share;
    }
  EXPECT_NEAR(static_cast<double>(kept) / kSamples, total, 0.005);
  EXPECT_TRUE(chiSquareAccepts(counts, expected, kLevel));
}

TEST(ChiSquare, CosineHemisphere) {
  for (const Vec3f& n : {Vec3f(0, 0, -1), normalize(Vec3f(1, 2, -3))})
    expectDensity([&](const Vec2f& u, float, Vec3f& d) { return d = sampleCosine(n, u), true; },
                  [&](const Vec3f& d) { return std::max(0.0f, dot(n, d)) / kPi; });
}

TEST(ChiSquare, CosineHemisphereFromThePathSampler) {
  const Vec3f n = normalize(Vec3f(-1, 1, 0.5f));
  uint32_t i = 0;
  expectDensity(
      [&](const Vec2f&, float, Vec3f& d) {
        const PathSampler sampler(3, RngStream::test, i / 64, (i / 16) % 4, i % 16);
        ++i;
        return d = sampleCosine(n, sampler.pair(4)), true;
      },
      [&](const Vec3f& d) { return std::max(0.0f, dot(n, d)) / kPi; });
}

TEST(ChiSquare, LinearSky) {
  Sky sky;
  sky.radiance = Vec3f(2);
  sky.linear = Vec3f(0.6f, -0.5f, 0.4f);
  const SkySampler sampler(sky);
  expectDensity([&](const Vec2f& u, float, Vec3f& d) { return d = sampler.sample(u), true; },
                [&](const Vec3f& d) { return sampler.pdf(d); });
}

TEST(ChiSquare, UniformSky) {
  Sky sky;
  sky.radiance = Vec3f(2);
  const SkySampler sampler(sky);
  expectDensity([&](const Vec2f& u, float, Vec3f& d) { return d = sampler.sample(u), true; },
                [&](const Vec3f&) { return 1 / (4 * kPi); });
}

TEST(ChiSquare, ImageSky) {
  Sky sky;
  sky.width = 16, sky.height = 8;
  Rng rng(2, RngStream::test);
  for (int i = 0; i < 128; ++i)
    sky.image.push_back(i % 5 == 0 ? Vec3f(0) : Vec3f(rng.nextFloat() * (i == 37 ? 100.0f : 1.0f)));
  sky.scale = 3;
  const SkySampler sampler(sky);
  expectDensity([&](const Vec2f& u, float, Vec3f& d) { return d = sampler.sample(u), true; },
                [&](const Vec3f& d) { return sampler.pdf(d); }, 120);
}

// A fan of emissive triangles of unequal power around the point, and a sky image besides.
TEST(ChiSquare, EmissiveTrianglesAndSkyTogether) {
  SceneBuilder builder;
  const uint32_t dim = builder.material(Vec3f(0), Vec3f(1));
  const uint32_t bright = builder.material(Vec3f(0), Vec3f(4, 1, 1));
  builder.quad(Vec3f(-1, 1, -1), Vec3f(1, 1, -1), Vec3f(1, 1, 1), Vec3f(-1, 1, 1), dim);
  builder.quad(Vec3f(-1, -1, 2), Vec3f(-1, 0, 2), Vec3f(1, 0, 2), Vec3f(1, -1, 2), bright);
  builder.quad(Vec3f(-1, -2, -1), Vec3f(-1, -2, 1), Vec3f(1, -2, 1), Vec3f(1, -2, -1),
               bright);  // its back: never a direction
  Sky& sky = builder.scene().sky;
  sky.width = 4, sky.height = 2;
  sky.image = {Vec3f(1), Vec3f(2), Vec3f(3), Vec3f(0), Vec3f(1), Vec3f(0), Vec3f(0), Vec3f(5)};
  const Scene scene = builder.finish();
  const MaterialTable table = makeMaterialTable(scene);
  const LightSampler lights(*scene.geometry, table, scene.sky);
  const Vec3f x(0.1f, 0.2f, -0.1f);
  const auto trianglesPdf = [&](const Vec3f& d) {
    double sum = 0;
    for (uint32_t i = 0; i < scene.geometry->triangles.size(); ++i) {
      const auto& v = scene.geometry->triangles[i].vertex;
      const Vec3d a(scene.geometry->positions[v[0]]), b(scene.geometry->positions[v[1]]),
          c(scene.geometry->positions[v[2]]);
      const Vec3d o(x), w(d), n = cross(b - a, c - a);
      if (dot(n, w) >= 0) continue;
      const double t = dot(n, a - o) / dot(n, w);
      const Vec3d p = o + w * t;
      const bool inside = t > 0 && dot(cross(b - a, p - a), n) >= 0 &&
                          dot(cross(c - b, p - b), n) >= 0 && dot(cross(a - c, p - c), n) >= 0;
      if (inside)
        sum +=
            lights.trianglePdf(i, static_cast<float>(t), static_cast<float>(dot(n, w) / length(n)));
    }
    return sum;
  };
  expectDensity(
      [&](const Vec2f& u, float choice, Vec3f& d) {
        const EmitterSample s = lights.sample(x, choice, u);
        return d = s.direction, s.pdf > 0;
      },
      [&](const Vec3f& d) { return trianglesPdf(d) + static_cast<double>(lights.skyPdf(d)); }, 80);
}

// The density that sample() reports is the one that the other strategy is weighted with.
TEST(LightSampler, ReportsItsOwnDensity) {
  SceneBuilder builder;
  builder.quad(Vec3f(-1, 1, -1), Vec3f(1, 1, -1), Vec3f(1, 1, 1), Vec3f(-1, 1, 1),
               builder.material(Vec3f(0), Vec3f(1)));
  const Scene scene = builder.finish();
  const MaterialTable table = makeMaterialTable(scene);
  const LightSampler lights(*scene.geometry, table, scene.sky);
  Rng rng(3, RngStream::test);
  for (int i = 0; i < 100; ++i) {
    const float a = rng.nextFloat(), b = rng.nextFloat(), c = rng.nextFloat();
    const EmitterSample s = lights.sample(Vec3f(0), c, {a, b});
    const float cosine = s.direction.y, distance_m = 1 / cosine;
    // Power and area are equal: density per area 1/4.
    EXPECT_NEAR(s.pdf, 0.25f * distance_m * distance_m / cosine, 1e-4f * s.pdf);
  }
}

// Halves are independent and equally good: over many points their errors do not correlate, and
// (A - B)^2 / 4 estimates the same variance as the passes' scatter.
TEST(Halves, AreIndependentAndTheirDifferenceMeasuresTheNoise) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(1), builder.material(Vec3f(0.8f), Vec3f(1)), true);
  const Scene scene = builder.finish();
  const EmbreeScene embree(scene);
  std::vector<IrradiancePoint> points;
  Rng rng(4, RngStream::test);
  const std::size_t n = 2000;
  for (std::size_t i = 0; i < n; ++i) {
    const float a = rng.nextFloat(), b = rng.nextFloat(), c = rng.nextFloat();
    points.push_back({Vec3f(0.01f) + Vec3f(a, b, c) * 0.98f, sampleSphere({c, a})});
  }
  SampleBudget budget;
  budget.spp = 256;
  const auto e = estimateIrradiance(scene, embree, points, budget, 9);
  const double truth = M_PI / (1 - static_cast<double>(0.8f));
  double ab = 0, aa = 0, bb = 0, difference = 0, variance = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double a = e.a[i].x - truth, b = e.b[i].x - truth;
    ab += a * b, aa += a * a, bb += b * b;
    difference += (a - b) * (a - b) / 4;
    variance += static_cast<double>(e.standard_error[i].x) * e.standard_error[i].x;
  }
  const double correlation = ab / std::sqrt(aa * bb);
  EXPECT_LT(std::abs(correlation), 4 / std::sqrt(static_cast<double>(n)));
  // A mean of n squares of normal numbers has a relative spread of sqrt(2 / n) = 3.2 %; the passes'
  // variances add sqrt(2 / (15 n)); heavier tails: 6 of these.
  EXPECT_NEAR(difference / variance, 1, 6 * 0.033);
}

}  // namespace
}  // namespace probelab::test
