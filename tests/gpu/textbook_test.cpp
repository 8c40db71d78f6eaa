// SPDX-License-Identifier: GPL-3.0-or-later
// The textbook baseline does what it is said to do: blending against its formulas in double,
// borders against continuity, the query against Probelab's own on the same texels.
#include "ddgi/textbook.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "base/error.h"
#include "base/rng.h"
#include "ddgi/directions.h"
#include "ddgi/snapshot.h"
#include "gpu_fixture.h"

namespace probelab {
namespace {

class Textbook : public GpuTest {};

Lattice smallLattice() { return {Vec3f(-1, 0, 2), Vec3f(0.75f, 1, 0.5f), Vec3i(3, 2, 4)}; }

double luminance(const Vec3d& c) { return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z; }
double largest(const Vec3d& c) { return std::max({c.x, c.y, c.z}); }

// Radiance up to 4, distances up to 3 m; probe 5 lies half in a wall, every third has a few back
// faces, and one ray in ten leaves the scene.
std::vector<Vec4f> randomRays(uint32_t probes, uint32_t rays, uint64_t seed) {
  std::vector<Vec4f> data;
  for (uint32_t probe = 0; probe < probes; ++probe) {
    Rng rng(seed, RngStream::test, probe);
    const double backfaces = probe == 5 ? 0.5 : (probe % 3 == 0 ? 0.04 : 0);
    const float brightness = 4 * rng.nextFloat();
    for (uint32_t ray = 0; ray < rays; ++ray) {
      float distance = 3 * rng.nextFloat();
      if (rng.nextDouble() < 0.1) distance = kMissDistance;
      if (rng.nextDouble() < backfaces) distance = -distance;
      data.emplace_back(brightness * rng.nextFloat(), brightness * rng.nextFloat(),
                        brightness * rng.nextFloat(), distance);
    }
  }
  return data;
}

struct BlendCase {
  TextbookSettings settings;
  double largest_distance = 0;
  const std::vector<Vec3f>* directions = nullptr;
  std::span<const Vec4f> rays;  // of one probe
};

// The formulas of the notes' "Blending [RTXGI]" with stored values doubled in front of the root.
Vec3d blendedIrradiance(const BlendCase& c, const Vec3d& u, const Vec3d& stored) {
  Vec3d sum;
  double weights = 0;
  int backfaces = 0;
  for (std::size_t i = 0; i < c.rays.size(); ++i) {
    if (c.rays[i].w < 0) {
      ++backfaces;
      continue;
    }
    const double w = std::max(0.0, dot(u, Vec3d((*c.directions)[i])));
    sum = sum + Vec3d(c.rays[i].x, c.rays[i].y, c.rays[i].z) * w;
    weights += w;
  }
  if (backfaces >= static_cast<int>(c.rays.size() / 10)) return stored;
  // In the SDK's units: half the mean under the root.
  const double to_sdk = std::pow(0.5, 1 / 5.0);
  const Vec3d half = sum * (0.5 / weights);
  const Vec3d fresh(std::pow(half.x, 0.2), std::pow(half.y, 0.2), std::pow(half.z, 0.2));
  const Vec3d old = stored * to_sdk;
  double h = dot(old, old) == 0 ? 0 : c.settings.hysteresis;
  if (largest(old - fresh) > c.settings.irradiance_threshold) h = std::max(0.0, h - 0.75);
  Vec3d step = fresh - old;
  if (luminance(step) > c.settings.brightness_threshold) step = step * 0.25;
  const Vec3d whole = step;
  step = step * (1 - h);
  if (largest(fresh) < largest(old))
    for (std::size_t k = 0; k < 3; ++k)
      step[k] = std::copysign(std::min(std::max(1.0 / 1024, std::abs(step[k])), std::abs(whole[k])),
                              whole[k]);
  return (old + step) * (1 / to_sdk);
}

Vec2d blendedMoments(const BlendCase& c, const Vec3d& u, const Vec2d& stored) {
  double sum = 0, sum_of_squares = 0, weights = 0;
  for (std::size_t i = 0; i < c.rays.size(); ++i) {
    const double w = std::pow(std::max(0.0, dot(u, Vec3d((*c.directions)[i]))), 50);
    const double r = std::min(std::abs(static_cast<double>(c.rays[i].w)), c.largest_distance);
    sum += w * r;
    sum_of_squares += w * r * r;
    weights += w;
  }
  const Vec2d fresh(sum / weights, sum_of_squares / weights);
  const double h = stored == Vec2d() ? 0 : c.settings.hysteresis;
  return fresh * (1 - h) + stored * h;
}

// Compares all interior texels of one update with `expected`, given the texels before it.
template <class Texel, class Wide>
void expectTexels(const std::vector<Texel>& after, const std::vector<Texel>& before, int side,
                  const std::function<Wide(std::size_t probe, Vec3d direction, Wide)>& expected,
                  double tolerance, std::size_t channels) {
  const auto n = static_cast<std::size_t>(side);
  for (std::size_t i = 0; i < after.size(); ++i) {
    const std::size_t x = i % n, y = i / n % n;
    if (x == 0 || y == 0 || x == n - 1 || y == n - 1) continue;
    const Vec3d u = texelDirection<double>(static_cast<double>(x - 1), static_cast<double>(y - 1),
                                           static_cast<double>(n - 2));
    const Wide wide = expected(i / (n * n), u, Wide(before[i]));
    for (std::size_t k = 0; k < channels; ++k)
      ASSERT_NEAR(after[i][k], wide[k], tolerance) << "texel " << i << " channel " << k;
  }
}

TEST_F(Textbook, BlendsAsTheFormulasSayInEveryFormatWithAndWithoutSharedMemory) {
  constexpr uint32_t kRays = 192;  // every distance texel has rays in its lobe
  const Lattice lattice = smallLattice();
  for (const bool full : {true, false})
    for (const bool shared_memory : {true, false}) {
      TextbookSettings settings;
      settings.rays = kRays;
      settings.full_floats = full;
      settings.shared_memory = shared_memory;
      settings.hysteresis = 0.9f;
      TextbookField field(gpu(), lattice, settings);
      for (uint64_t update = 0; update < 4; ++update) {
        const std::vector<Vec3f> directions = updateDirections(kRays, 3, update);
        const std::vector<Vec4f> rays = randomRays(field.probeCount(), kRays, update);
        const auto irradiance = field.irradianceTexels();
        const auto moments = field.momentTexels();
        field.setRays(directions, rays);
        field.blend();
        BlendCase c{settings, 1.5 * length(Vec3d(lattice.spacing)), &directions, {}};
        const auto probeCase = [&](std::size_t probe) {
          c.rays = std::span<const Vec4f>(rays).subspan(probe * kRays, kRays);
          return c;
        };
        // fp32: Vulkan's pow. fp16: a unit in the last place, a store may truncate; the largest
        // texels are below 2 (4^(1/5)) and below 4 (clamp 1.5 |s| = 2.02 m, squared 4.08) or 8.
        expectTexels<Vec3f, Vec3d>(
            field.irradianceTexels(), irradiance, 8,
            [&](std::size_t probe, Vec3d u, Vec3d stored) {
              return blendedIrradiance(probeCase(probe), u, stored);
            },
            full ? 1e-4 : 1e-4 + 0x1p-10, 3);
        expectTexels<Vec2f, Vec2d>(
            field.momentTexels(), moments, 16,
            [&](std::size_t probe, Vec3d u, Vec2d stored) {
              return blendedMoments(probeCase(probe), u, stored);
            },
            full ? 4e-4 : 4e-4 + 0x1p-8, 2);
        if (HasFatalFailure()) FAIL() << "update " << update << " full " << full;
      }
    }
}

TEST_F(Textbook, ChangeDetectionSwitchesAtItsThresholds) {
  // Grey probes that darken by 0.19 to 0.31 and brighten by 0.04 to 0.16 in the SDK's units, where
  // the thresholds are 0.25 and 0.1.
  constexpr uint32_t kRays = 32;
  TextbookSettings settings;
  settings.rays = kRays;
  settings.full_floats = true;
  TextbookField field(gpu(), smallLattice(), settings);
  const std::vector<Vec3f> directions = updateDirections(kRays, 3, 0);
  std::vector<Vec4f> rays(std::size_t{24} * kRays, Vec4f(1e4f, 1e4f, 1e4f, 1));
  field.setRays(directions, rays);
  field.blend();
  const std::vector<Vec3f> before = field.irradianceTexels();
  for (std::size_t probe = 0; probe < 24; ++probe) {
    const double change = probe < 12 ? -0.19 - 0.01 * static_cast<double>(probe) - 0.005
                                     : 0.04 + 0.01 * static_cast<double>(probe - 12) + 0.005;
    const double stored = before[probe * 64 + 27].x * std::pow(0.5, 0.2) + change;
    const auto radiance = static_cast<float>(2 * std::pow(stored, 5));
    for (std::size_t ray = 0; ray < kRays; ++ray)
      rays[probe * kRays + ray] = Vec4f(radiance, radiance, radiance, 1);
  }
  field.setRays(directions, rays);
  field.blend();
  expectTexels<Vec3f, Vec3d>(
      field.irradianceTexels(), before, 8,
      [&](std::size_t probe, Vec3d u, Vec3d stored) {
        const BlendCase c{settings, 0, &directions,
                          std::span<const Vec4f>(rays).subspan(probe * kRays, kRays)};
        return blendedIrradiance(c, u, stored);
      },
      2e-4, 3);  // 1e-4 of values up to 2
}

// Bilinear reading of channel x in a tile with its border.
template <class Texel>
double readTexel(const std::vector<Texel>& texels, std::size_t probe, int side, const Vec3d& d) {
  const Vec2d e = octEncode(d);
  const double u = (0.5 * e.x + 0.5) * (side - 2) + 0.5, v = (0.5 * e.y + 0.5) * (side - 2) + 0.5;
  const int x = std::min(static_cast<int>(u), side - 2),
            y = std::min(static_cast<int>(v), side - 2);
  const auto at = [&](int dx, int dy) {
    const auto texel = static_cast<std::size_t>((y + dy) * side + x + dx);
    return static_cast<double>(texels[probe * static_cast<std::size_t>(side * side) + texel].x);
  };
  return (at(0, 0) * (1 - (u - x)) + at(1, 0) * (u - x)) * (1 - (v - y)) +
         (at(0, 1) * (1 - (u - x)) + at(1, 1) * (u - x)) * (v - y);
}

TEST_F(Textbook, BordersMakeReadingsContinuousOverSeamsAndCorners) {
  TextbookSettings settings;
  settings.rays = 192;
  TextbookField field(gpu(), smallLattice(), settings);
  field.setRays(updateDirections(192, 3, 0), randomRays(field.probeCount(), 192, 7));
  field.blend();
  const auto irradiance = field.irradianceTexels();
  const auto moments = field.momentTexels();
  // A step off the seam moves the reading by at most half of 14 texels times the step, on each
  // side; a texel's width changes it by at most the contrast, 4.1.
  constexpr double kStep = 1e-6, kTolerance = 2 * 7 * kStep * 4.1;
  Rng rng(4, RngStream::test);
  for (int i = 0; i < 500; ++i) {
    const std::size_t probe = rng.nextBelow(24);
    // The edges of the map are the meridians of the lower half over the axes, its corners the pole.
    const double across = i % 10 == 0 ? 0 : 2 * rng.nextDouble() - 1;
    const double down = -std::sqrt(1 - across * across);
    for (const bool swap : {false, true}) {
      const auto direction = [&](double side) {
        const Vec3d d =
            swap ? Vec3d(across, side * kStep, down) : Vec3d(side * kStep, across, down);
        return normalize(d);
      };
      EXPECT_NEAR(readTexel(irradiance, probe, 8, direction(-1)),
                  readTexel(irradiance, probe, 8, direction(1)), kTolerance);
      EXPECT_NEAR(readTexel(moments, probe, 16, direction(-1)),
                  readTexel(moments, probe, 16, direction(1)), kTolerance);
    }
  }
}

// How far the walls around a probe are: an ellipsoid; a sphere, whose distances have no variance;
// two spheres that the rays meet in turn, whose variance is large.
enum class Walls { ellipsoid, sphere, two_spheres };

// A linear sky and walls for each probe, all random.
std::vector<Vec4f> smoothRays(uint32_t probes, const std::vector<Vec3f>& directions, Walls walls) {
  std::vector<Vec4f> data;
  for (uint32_t probe = 0; probe < probes; ++probe) {
    Rng rng(9, RngStream::test, probe);
    const auto random = [&] { return Vec3f(rng.nextFloat(), rng.nextFloat(), rng.nextFloat()); };
    const Vec3f base = Vec3f(0.2f) + random(), slope = random() * 0.15f;
    const Vec3f axes = Vec3f(0.6f) + random() * 0.8f;
    for (std::size_t i = 0; i < directions.size(); ++i) {
      const Vec3f& d = directions[i];
      const Vec3f radiance = base + slope * (d.x + d.y - d.z);
      float distance = 1 / length(d / axes);
      if (walls == Walls::sphere) distance = axes.x;
      if (walls == Walls::two_spheres) distance = axes.x * (i % 2 == 0 ? 0.7f : 1.3f);
      data.emplace_back(radiance.x, radiance.y, radiance.z, distance);
    }
  }
  return data;
}

// Adds to every texel of a probe what filtering may be off: 2^-8 of the contrast of the texels
// around (a bilinear reading is then off by an average of that).
template <class Texel>
void perturb(std::vector<Texel>& texels, std::size_t probe, int side, std::size_t k, double sign) {
  const std::vector<Texel> exact = texels;
  const auto at = [&](int x, int y) {
    return (probe * static_cast<std::size_t>(side) + static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(side) +
           static_cast<std::size_t>(x);
  };
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      float low = exact[at(x, y)][k], high = low;
      for (int j = std::max(y - 1, 0); j <= std::min(y + 1, side - 1); ++j)
        for (int i = std::max(x - 1, 0); i <= std::min(x + 1, side - 1); ++i) {
          low = std::min(low, exact[at(i, j)][k]);
          high = std::max(high, exact[at(i, j)][k]);
        }
      texels[at(x, y)][k] += static_cast<float>(sign * 0x1p-8 * (high - low));
    }
}

std::vector<double> redOf(const FieldSnapshot& snapshot, const std::vector<QueryPoint>& points) {
  std::vector<double> values;
  for (const QueryPoint& point : points)
    values.push_back(querySnapshot(snapshot, snapshot.params, point).irradiance.x);
  return values;
}

// How far the irradiance may be off at each point: every reading's share, added.
std::vector<double> filteringTolerances(const FieldSnapshot& exact,
                                        const std::vector<QueryPoint>& points, std::size_t probes) {
  const std::vector<double> values = redOf(exact, points);
  std::vector<double> sums(points.size(), 1e-4);  // the arithmetic's; the irradiance is below 2 pi
  for (std::size_t probe = 0; probe < probes; ++probe)
    for (int reading = 0; reading < 3; ++reading) {
      std::vector<double> worst(points.size(), 0.0);
      for (const double sign : {-1.0, 1.0}) {
        FieldSnapshot off = exact;
        if (reading == 0) perturb(off.irradiance, probe, 8, 0, sign);
        if (reading > 0)
          perturb(off.moments, probe, 16, static_cast<std::size_t>(reading - 1), sign);
        const std::vector<double> changed = redOf(off, points);
        for (std::size_t i = 0; i < points.size(); ++i)
          worst[i] = std::max(worst[i], std::abs(changed[i] - values[i]));
      }
      for (std::size_t i = 0; i < points.size(); ++i) sums[i] += worst[i];
    }
  return sums;
}

Vec3f randomDirection(Rng& rng) {
  const double z = 1 - 2 * rng.nextDouble(), phi = 2 * std::numbers::pi * rng.nextDouble();
  const double s = std::sqrt(std::max(0.0, 1 - z * z));
  return Vec3f(Vec3d(s * std::cos(phi), s * std::sin(phi), z));
}

// What the query of Probelab needs to read the texels of a textbook field.
FieldSnapshot rtxgiSnapshot(TextbookField& field, const Lattice& lattice, const Box3f& box) {
  Params params = loadParams("rtxgi");
  params.normal_bias = params.view_bias = 0.1;  // the spacing is 1 m
  const ProbeLayout layout =
      latticeLayout(lattice, box, std::vector<uint8_t>(field.probeCount(), 1));
  FieldSnapshot snapshot;
  snapshot.lattice = latticeShape(layout, params);
  snapshot.modes = queryModes(params);
  snapshot.params = queryParams(params);
  snapshot.params.variance_floor = 0;  // these moments are not rounded
  snapshot.probe_of_point = layout.probe_of_point;
  snapshot.irradiance = field.irradianceTexels();
  const float r = layout.support_radius_m;
  for (const Vec2f& m : field.momentTexels()) snapshot.moments.emplace_back(m.x / r, m.y / (r * r));
  return snapshot;
}

std::vector<QueryPoint> pointsWithin(const Box3f& box, int count) {
  Rng rng(6, RngStream::test);
  std::vector<QueryPoint> points;
  for (int i = 0; i < count; ++i) {
    const Vec3f u(rng.nextFloat(), rng.nextFloat(), rng.nextFloat());
    points.push_back({box.min + u * box.extent(), randomDirection(rng), randomDirection(rng)});
  }
  return points;
}

TEST_F(Textbook, QueriesAgreeWithProbelabsOwnOnTheSameTexels) {
  const Lattice lattice{Vec3f(-1, 0, 2), Vec3f(1), Vec3i(3, 2, 3)};
  const Box3f box{lattice.first, lattice.first + lattice.spacing * Vec3f(2, 1, 2)};
  // Biases do not lead out of the lattice, where the two extrapolate differently.
  const std::vector<QueryPoint> points =
      pointsWithin({box.min + Vec3f(0.2f), box.max - Vec3f(0.2f)}, 300);
  const std::vector<Vec3f> directions = updateDirections(1024, 5, 0);
  for (const Walls walls : {Walls::ellipsoid, Walls::sphere, Walls::two_spheres}) {
    TextbookSettings settings;
    settings.rays = 1024;
    settings.full_floats = true;
    settings.brightness_threshold = 1e9f;  // the first update counts in full
    TextbookField field(gpu(), lattice, settings);
    field.setRays(directions, smoothRays(field.probeCount(), directions, walls));
    field.blend();
    const FieldSnapshot snapshot = rtxgiSnapshot(field, lattice, box);
    const std::vector<Vec3f> results = field.query(points);
    const std::vector<double> exact = redOf(snapshot, points);
    const std::vector<double> allowed = filteringTolerances(snapshot, points, field.probeCount());
    double tolerances = 0, values = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_NEAR(results[i].x, exact[i], allowed[i]) << i << " walls " << static_cast<int>(walls);
      tolerances += allowed[i];
      values += exact[i];
    }
    EXPECT_LT(tolerances, 0.02 * values);  // or the comparison says nothing
  }
}

TEST_F(Textbook, AUniformFieldIsPiInsideAndFadesOutOverOneSpacing) {
  const Lattice lattice{Vec3f(-1, 0, 2), Vec3f(1, 2, 0.5f), Vec3i(3, 2, 2)};
  TextbookSettings settings;
  settings.rays = 64;
  settings.brightness_threshold = 1e9f;
  TextbookField field(gpu(), lattice, settings);
  field.setRays(updateDirections(64, 5, 0),
                std::vector<Vec4f>(field.probeCount() * std::size_t{64}, Vec4f(1, 1, 1, 5)));
  field.blend();
  const Vec3f up(0, 1, 0);
  const std::vector<QueryPoint> points{{{0.3f, 0.7f, 2.2f}, up, -up},
                                       {{1.5f, 0.7f, 2.2f}, up, -up},
                                       {{0.3f, -0.5f, 2.2f}, up, -up},
                                       {{-1.5f, -1, 2.2f}, up, -up},
                                       {{0.3f, 0.7f, 3.1f}, up, -up}};
  const std::vector<double> share{1, 0.5, 0.75, 0.25, 0};
  const std::vector<Vec3f> results = field.query(points);
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_NEAR(results[i].y, share[i] * std::numbers::pi, 1e-4 * std::numbers::pi) << i;
}

TEST_F(Textbook, MoreProbesThanOneDispatchTakesComeInBatches) {
  const Lattice lattice{Vec3f(0), Vec3f(1), Vec3i(64, 16, 65)};
  TextbookSettings settings;
  settings.rays = 4;
  settings.brightness_threshold = 1e9f;
  settings.full_floats = true;
  TextbookField field(gpu(), lattice, settings);
  ASSERT_GT(field.probeCount(), 65536u);
  std::vector<Vec4f> rays;
  for (uint32_t i = 0; i < 4 * field.probeCount(); ++i)
    rays.emplace_back(static_cast<float>(1 + i / 4), 0.0f, 0.0f, 1.0f);
  const std::vector<Vec3f> tetrahedron{{0.57735f, 0.57735f, 0.57735f},
                                       {-0.57735f, -0.57735f, 0.57735f},
                                       {-0.57735f, 0.57735f, -0.57735f},
                                       {0.57735f, -0.57735f, -0.57735f}};
  field.setRays(tetrahedron, rays);
  field.blend();
  const std::vector<Vec3f> texels = field.irradianceTexels();
  for (uint32_t probe = 0; probe < field.probeCount(); ++probe) {
    const double expected = std::pow(1.0 + probe, 0.2);
    ASSERT_NEAR(texels[probe * std::size_t{64} + 27].x, expected, 1e-4 * expected) << probe;
  }
}

TEST_F(Textbook, AnAtlasBeyondTheDevicesLimitsIsAnError) {
  const auto count = static_cast<int>(gpu().info().max_image_side / 16 + 1);
  EXPECT_THROW(TextbookField(gpu(), {Vec3f(0), Vec3f(1), Vec3i(count, 1, 1)}, {}), DeviceError);
}

TEST_F(Textbook, TimesEveryRepeat) {
  TextbookSettings settings;
  settings.rays = 64;
  TextbookField field(gpu(), smallLattice(), settings);
  field.setRays(updateDirections(64, 5, 0), randomRays(field.probeCount(), 64, 1));
  const auto blends = field.timeBlend(3);
  ASSERT_EQ(blends.size(), 3u);
  for (const TextbookBlendTime& time : blends)
    EXPECT_TRUE(time.irradiance_ms > 0 && time.moments_ms > 0);
  const std::vector<QueryPoint> points(1000, {Vec3f(0, 0.5f, 3), Vec3f(0, 1, 0), Vec3f(1, 0, 0)});
  const auto queries = field.timeQuery(points, 2);
  ASSERT_EQ(queries.size(), 2u);
  for (const double ms : queries) EXPECT_GT(ms, 0);
}

}  // namespace
}  // namespace probelab
