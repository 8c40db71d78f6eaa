// SPDX-License-Identifier: GPL-3.0-or-later
// Relocation and classification against plain C++ over Embree's hits of the fixed rays; moved
// probes in the query; variability, early stop and reduced rays.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "scattered_helpers.h"
#include "update_oracle.h"

namespace probelab {
namespace {

using test::boxLayout;
using test::exactParams;
using test::FieldScene;
using test::SceneBuilder;

class StatesOracle : public GpuTest {};

constexpr float kFar = 1e27f;

// A room with boxes at random, all of it times `scale`; the boxes in `boxes`.
Scene boxesScene(uint64_t seed, float scale, std::vector<Box3f>* boxes = nullptr) {
  Rng rng(seed, RngStream::test, 2);
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f), Vec3f(1));
  builder.box(Vec3f(0), Vec3f(4, 3, 4) * scale, m, true);
  for (int i = 0; i < 7; ++i) {
    const Vec3f low(3 * rng.nextFloat(), 2 * rng.nextFloat(), 3 * rng.nextFloat());
    const Vec3f size(0.1f + rng.nextFloat(), 0.1f + rng.nextFloat(), 0.1f + rng.nextFloat());
    const Box3f box{low * scale, (low + size) * scale};
    builder.box(box.min, box.max, m, false);
    if (boxes != nullptr) boxes->push_back(box);
  }
  return builder.finish();
}

ProbeLayout boxesLayout(const Scene& scene, float scale, const Vec3i& count = Vec3i(7, 5, 6)) {
  return boxLayout({Vec3f(0.15f) * scale, Vec3f(3.9f, 2.8f, 3.8f) * scale}, count, scene.bounds);
}

Params statesParams(int classification = PL_CLASSIFY_NEAR_SURFACE) {
  Params params = exactParams("rtxgi");
  params.rays = 16;
  params.relocation = 1;
  params.relocation_front = 0.3;
  params.classification = classification;
  return params;
}

// Signed distances of the fixed rays from a place: negative on a back face, kFar on a miss.
std::vector<float> fixedDistances(const FieldScene& scene, const Vec3f& place,
                                  const std::vector<Vec3f>& directions) {
  std::vector<float> distances;
  for (const Vec3f& d : directions) {
    const Hit hit = scene.embree.closest({place, 0, d, 1e27f});
    if (hit.primitive == kNoHit) {
      distances.push_back(kFar);
      continue;
    }
    const Geometry& g = *scene.scene.geometry;
    const bool back = dot(faceNormal(g, hit.primitive), d) > 0;
    distances.push_back(back ? -hit.t : hit.t);
  }
  return distances;
}

struct Probe {
  Vec3f place;
  bool active = true;
};

// The published rules with their world units replaced: (1) more than a quarter back faces: through
// the nearest one and half the kept distance beyond; (2) a front face nearer than kept: towards the
// farthest front face by what is missing, at most half-way, if that leads away from the nearest;
// (3) otherwise back home by the room there is. A step that ends beyond the limit is not taken.
Vec3f relocatedOffset(const std::vector<float>& distances, const std::vector<Vec3f>& directions,
                      const Vec3f& offset, double share, float kept) {
  int back = 0;
  std::size_t nearest_back = 0, nearest = 0, farthest = 0;
  float back_t = kFar, near_t = kFar, far_t = 0;
  for (std::size_t r = 0; r < distances.size(); ++r) {
    const float t = distances[r];
    if (t < 0) {
      ++back;
      if (-t < back_t) back_t = -t, nearest_back = r;
    } else {
      if (t < near_t) near_t = t, nearest = r;
      if (t > far_t) far_t = t, farthest = r;
    }
  }
  if (back > share * static_cast<double>(distances.size()))
    return offset + directions[nearest_back] * (back_t + 0.5f * kept);
  if (near_t < kept) {
    if (dot(directions[nearest], directions[farthest]) > 0) return offset;
    return offset + directions[farthest] * std::min(kept - near_t, 0.5f * far_t);
  }
  const float away = length(offset);
  return away == 0 ? offset : offset * (1 - std::min(near_t - kept, away) / away);
}

std::vector<Probe> settleByHand(const FieldScene& scene, const ProbeLayout& layout,
                                const Params& params) {
  std::vector<Vec3f> directions;
  for (const Vec3d& d : sphericalFibonacci(params.fixed_rays)) directions.emplace_back(d);
  std::vector<Probe> probes;
  for (std::size_t p = 0; p < layout.positions.size(); ++p) {
    const Vec3f& home = layout.positions[p];
    const float bias = probeLengths(layout, p).bias;
    const float kept = static_cast<float>(params.relocation_front) * bias;
    const Vec3f spacing = layout.lengths.empty() ? layout.lattice.spacing : Vec3f(bias);
    Probe probe{home};
    for (int i = 0; params.relocation != 0 && i < params.relocation_iterations; ++i) {
      const Vec3f offset =
          relocatedOffset(fixedDistances(scene, probe.place, directions), directions,
                          probe.place - home, params.backface_threshold, kept);
      if (length(offset / spacing) < static_cast<float>(params.relocation_limit))
        probe.place = home + offset;
    }
    const std::vector<float> distances = fixedDistances(scene, probe.place, directions);
    const auto back =
        std::count_if(distances.begin(), distances.end(), [](float t) { return t < 0; });
    bool around = false;
    for (std::size_t r = 0; r < distances.size(); ++r) {
      const Vec3f reach = directions[r] * distances[r] / spacing;
      around = around || (distances[r] > 0 && std::abs(reach.x) <= 1 && std::abs(reach.y) <= 1 &&
                          std::abs(reach.z) <= 1);
    }
    if (params.classification != PL_CLASSIFY_NONE)
      probe.active = static_cast<double>(back) <= params.backface_threshold * params.fixed_rays &&
                     (around || params.classification != PL_CLASSIFY_NEAR_SURFACE);
    probes.push_back(probe);
  }
  return probes;
}

class StatesByLayout : public StatesOracle, public ::testing::WithParamInterface<bool> {};

// A comparison that falls the other way by rounding moves a probe elsewhere: a few may, of 210.
TEST_P(StatesByLayout, RelocationAndClassificationEqualThePlainLoop) {
  int moved = 0, inactive = 0;
  for (const uint64_t seed : {1, 2, 3}) {
    const FieldScene scene(boxesScene(seed, 1));
    const ProbeLayout layout =
        GetParam() ? test::randomScattered({Vec3f(0.15f), Vec3f(3.9f, 2.8f, 3.8f)}, 210,
                                           Vec3i(5, 4, 5), scene.scene.bounds, seed)
                   : boxesLayout(scene.scene, 1);
    for (const int rays : {32, 100}) {
      Params params = statesParams(seed == 1 ? PL_CLASSIFY_INSIDE : PL_CLASSIFY_NEAR_SURFACE);
      params.fixed_rays = rays;
      const auto field = scene.field(gpu(), layout, params);
      const std::vector<Probe> expected = settleByHand(scene, layout, params);
      int elsewhere = 0;
      for (std::size_t p = 0; p < expected.size(); ++p) {
        const Vec3f& place = field->states().positions[p];
        moved += length(place - layout.positions[p]) > 0 ? 1 : 0;
        inactive += expected[p].active ? 0 : 1;
        const bool same = length(place - expected[p].place) < 1e-4f &&
                          (field->states().active[p] != 0) == expected[p].active;
        elsewhere += same ? 0 : 1;
        const Vec3f spacing = GetParam() ? Vec3f(layout.lengths[p].bias) : layout.lattice.spacing;
        const Vec3f share = (place - layout.positions[p]) / spacing;
        EXPECT_LE(length(share), 0.45f * 1.00001f);
      }
      EXPECT_LE(elsewhere, 2) << "seed " << seed << ", " << rays << " rays";
    }
  }
  EXPECT_GT(moved, GetParam() ? 150 : 200);
  EXPECT_GT(inactive, 20);
}

INSTANTIATE_TEST_SUITE_P(Layouts, StatesByLayout, ::testing::Bool(), [](const auto& info) {
  return std::string(info.param ? "Scattered" : "Lattice");
});

// Nothing in the rules has a unit: scaled by a power of two, every step scales exactly.
TEST_F(StatesOracle, OffsetsScaleWithTheScene) {
  const FieldScene scene(boxesScene(4, 1));
  const ProbeLayout layout = boxesLayout(scene.scene, 1);
  const auto field = scene.field(gpu(), layout, statesParams());
  for (const float scale : {0x1p7f, 0x1p-7f}) {
    const FieldScene scaled(boxesScene(4, scale));
    const auto other = scaled.field(gpu(), boxesLayout(scaled.scene, scale), statesParams());
    EXPECT_EQ(other->states().active, field->states().active) << scale;
    for (std::size_t p = 0; p < layout.positions.size(); ++p)
      ASSERT_EQ(other->states().positions[p], field->states().positions[p] * scale) << scale;
  }
}

// A box that a probe can leave within its limit holds no probe afterwards.
TEST_F(StatesOracle, ProbesLeaveTheBoxesThatTheyCan) {
  for (const uint64_t seed : {5, 6}) {
    std::vector<Box3f> boxes;
    const FieldScene scene(boxesScene(seed, 1, &boxes));
    const ProbeLayout layout = boxesLayout(scene.scene, 1);
    Params params = statesParams();
    params.fixed_rays = 100;
    const auto field = scene.field(gpu(), layout, params);
    const float kept = 0.3f * layout.bias_length_m;
    const auto holders = [&](const Vec3f& p) {
      return std::count_if(boxes.begin(), boxes.end(), [&](const Box3f& b) {
        return minComponent(p - b.min) > 0 && minComponent(b.max - p) > 0;
      });
    };
    int left = 0, held = 0;
    for (std::size_t p = 0; p < layout.positions.size(); ++p) {
      const Vec3f& home = layout.positions[p];
      if (holders(home) != 1) continue;  // open, or boxes in boxes
      const Box3f& box = *std::find_if(boxes.begin(), boxes.end(), [&](const Box3f& b) {
        return minComponent(home - b.min) > 0 && minComponent(b.max - home) > 0;
      });
      const float exit = std::min(minComponent(home - box.min), minComponent(box.max - home));
      // 100 rays miss the shortest way by up to 0.22 rad, 2.5 % longer.
      const float step = 1.1f * exit + 0.5f * kept;
      if (step > 0.44f * minComponent(layout.lattice.spacing)) continue;
      ++held;
      left += holders(field->states().positions[p]) == 0 ? 1 : 0;
    }
    EXPECT_GE(held, 4);
    EXPECT_EQ(left, held) << seed;
  }
}

// Irradiance of a field along a line, densely; moved probes and weights that follow them.
struct Scan {
  double largest_step = 0, range = 0;
};
Scan scanLine(ProbeField& field, const Vec3f& from, const Vec3f& to) {
  constexpr int kPoints = 20001;
  const Vec3f normal = normalize(Vec3f(0.3f, 1, -0.2f));
  std::vector<QueryPoint> points;
  for (int i = 0; i < kPoints; ++i)
    points.push_back(
        {from + (to - from) * (static_cast<float>(i) / (kPoints - 1)), normal, -normal});
  Scan scan;
  double low = 1e30, high = 0, before = -1;
  for (const Vec4f& e : field.query(points)) {
    const double now = static_cast<double>(e.x);
    if (before >= 0) scan.largest_step = std::max(scan.largest_step, std::abs(now - before));
    low = std::min(low, now), high = std::max(high, now);
    before = now;
  }
  scan.range = high - low;
  return scan;
}

// Interpolation alone, without visibility: steps of 1/5,000 of a cell cannot change E by more than
// a few 1/5,000 of its range; a jump at a cell's border would.
TEST_F(StatesOracle, WeightsThatFollowMovedProbesAreContinuousAcrossCells) {
  const FieldScene scene(test::randomRoom(9));
  const ProbeLayout layout =
      boxLayout({Vec3f(0.2f), Vec3f(3.8f, 1.8f, 1.8f)}, Vec3i(5, 3, 3), scene.scene.bounds);
  Params params = exactParams("classic");
  params.relocation = 1;
  params.relocation_front = 0.4;
  params.offset_weights = 1;
  const auto field = scene.field(gpu(), layout, params);
  ASSERT_TRUE(isMoved(layout, field->states()));
  field->update(0, {}, {});
  for (const float height : {0.31f, 0.77f, 1.2f}) {
    const Scan scan =
        scanLine(*field, Vec3f(0.1f, height, 0.13f), Vec3f(3.9f, height + 0.3f, 1.9f));
    EXPECT_GT(scan.range, 0);
    EXPECT_LT(scan.largest_step, 0.005 * scan.range) << height;
  }
}

// At a moved probe's own place its tent is 1 and its neighbours' tents still overlap; where nothing
// moved, both kinds of weights are the plain trilinear ones.
TEST_F(StatesOracle, WeightsWithoutMovedProbesArePlainTrilinear) {
  const FieldScene scene(test::randomRoom(9));
  const ProbeLayout layout =
      boxLayout({Vec3f(0.2f), Vec3f(3.8f, 1.8f, 1.8f)}, Vec3i(5, 3, 3), scene.scene.bounds);
  for (double x = 0; x <= 4; x += 0.01)
    for (int corner = static_cast<int>(x); corner <= static_cast<int>(x) + 1; ++corner)
      EXPECT_NEAR(axisWeight(x, corner, static_cast<double>(corner)), 1 - std::abs(x - corner),
                  1e-12);
  Params params = exactParams("rtxgi");
  const auto plain = scene.field(gpu(), layout, params);
  params.offset_weights = 1;
  const auto offset = scene.field(gpu(), layout, params);
  plain->update(0, {}, {});
  offset->update(0, {}, {});
  EXPECT_EQ(plain->irradianceTexels(), offset->irradianceTexels());
  std::vector<QueryPoint> points;
  for (int i = 0; i < 200; ++i)
    points.push_back(
        {Vec3f(0.01f * static_cast<float>(i), 0.7f, 1), Vec3f(0, 1, 0), Vec3f(0, -1, 0)});
  EXPECT_EQ(plain->query(points), offset->query(points));
}

// Variability: mean over interior texels of active probes that are not black of |a - b| / sqrt 2
// over (a + b) / 2, the coefficient of variation of two values, in luminance as stored.
TEST_F(StatesOracle, VariabilityIsThatOfTheStoredTexels) {
  const FieldScene scene(test::randomRoom(10));
  const ProbeLayout layout =
      boxLayout({Vec3f(0.2f), Vec3f(3.8f, 1.8f, 1.8f)}, Vec3i(6, 3, 3), scene.scene.bounds);
  for (const char* preset : {"rtxgi", "probelab"}) {
    Params params = loadParams(preset);
    params.rays = 64;
    params.variability_threshold = 1e-6;
    params.classification = PL_CLASSIFY_INSIDE;
    const auto field = scene.field(gpu(), layout, params);
    ASSERT_LT(field->states().activeCount(), field->probeCount());
    EXPECT_EQ(field->variability(), 1);
    field->update(0, {}, {});
    const test::Texels before = test::storedTexels(*field);
    field->update(1, {.hysteresis = 0.5f}, {.hysteresis = 0.5f});
    const test::Texels after = test::storedTexels(*field);
    const Vec3d luminance(0.2126, 0.7152, 0.0722);
    const std::size_t texels = before.irradiance.size() / field->probeCount();
    double sum = 0, lit = 0;
    for (std::size_t i = 0; i < before.irradiance.size(); ++i) {
      const double a = dot(before.irradiance[i], luminance);
      const double b = dot(after.irradiance[i], luminance);
      if (field->states().active[i / texels] == 0 || a + b <= 0) continue;
      sum += std::abs(a - b) / std::sqrt(2.0) / ((a + b) / 2);
      lit += 1;
    }
    const double expected = sum / lit;
    EXPECT_GT(expected, 0.001);
    EXPECT_NEAR(field->variability(), expected, 1e-5 * expected + 1e-7);
  }
}

TEST_F(StatesOracle, TemporalRunsStopBelowTheThresholdAndNotBefore) {
  const FieldScene scene(test::randomRoom(11));
  const ProbeLayout layout =
      boxLayout({Vec3f(0.2f), Vec3f(3.8f, 1.8f, 1.8f)}, Vec3i(4, 3, 3), scene.scene.bounds);
  Params params = exactParams("rtxgi");
  params.rays = 64;
  params.variability_threshold = 0.004;
  const auto field = scene.field(gpu(), layout, params);
  std::vector<double> history;
  const int done =
      runTemporal(*field, 200, [&](int, int) { history.push_back(field->variability()); });
  ASSERT_EQ(static_cast<std::size_t>(done), history.size());
  EXPECT_LT(done, 200);
  EXPECT_GT(done, 2);
  EXPECT_LT(history.back(), 0.004);
  for (std::size_t i = 0; i + 1 < history.size(); ++i) EXPECT_GE(history[i], 0.004);
  params.variability_threshold = 0;
  EXPECT_EQ(runTemporal(*scene.field(gpu(), layout, params), 7), 7);
}

// In a furnace every probe is flat: all get half the rays from the second update on, and the answer
// is the same closed form, E = pi / (1 - albedo) in the limit; here one update of pi L and so on.
TEST_F(StatesOracle, FlatProbesTakeFewerRays) {
  const FieldScene scene(test::furnaceScene(0.5f, 1));
  const ProbeLayout layout =
      boxLayout({Vec3f(0.2f), Vec3f(1.8f)}, Vec3i(3, 3, 3), scene.scene.bounds);
  Params params = exactParams("rtxgi");
  params.rays = 200;
  params.flat_ray_share = 0.25;
  params.flat_brightness = 0.5;
  const auto field = scene.field(gpu(), layout, params);
  EXPECT_EQ(field->workOfUpdate().rays, 27u * 200);
  for (uint64_t u = 0; u < 20; ++u) field->update(u, {}, {});
  EXPECT_EQ(field->workOfUpdate().rays, 27u * 50);
  const Vec3f up(0, 1, 0);
  const std::vector<QueryPoint> points{{Vec3f(0.7f, 0, 0.9f), up, -up}, {Vec3f(1, 1, 1), up, -up}};
  for (const Vec4f& e : field->query(points))
    EXPECT_NEAR(e.x, 2 * std::numbers::pi, 1e-3 * 2 * std::numbers::pi);
}

// Only bright and flat probes take fewer rays, and the mean stays within the noise of full rays.
TEST_F(StatesOracle, SharpProbesKeepTheirRays) {
  const FieldScene scene(test::randomRoom(12));
  const ProbeLayout layout =
      boxLayout({Vec3f(0.2f), Vec3f(3.8f, 1.8f, 1.8f)}, Vec3i(6, 3, 3), scene.scene.bounds);
  Params params = exactParams("probelab");
  params.rays = 64;
  params.irradiance_texels = params.moment_texels = 8;
  params.flat_contrast = 1;
  const auto meanOf = [&](double share, uint64_t seed, uint64_t* rays) {
    params.flat_ray_share = share;
    const auto field = scene.field(gpu(), layout, params, {.seed = seed});
    runTemporal(*field, 4);
    *rays = field->workOfUpdate().rays;
    double sum = 0;
    const test::Texels texels = test::storedTexels(*field);
    for (const Vec3d& t : texels.irradiance) sum += t.y;
    return sum / static_cast<double>(texels.irradiance.size());
  };
  constexpr uint64_t kSeeds = 5;
  uint64_t full_rays = 0, reduced_rays = 0;
  double mean = 0, square = 0, full = 0;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    full = meanOf(1, seed, &full_rays);
    const double d = meanOf(0.5, seed, &reduced_rays) - full;
    mean += d / kSeeds;
    square += d * d / kSeeds;
  }
  EXPECT_EQ(full_rays, 54u * 64);
  EXPECT_LT(reduced_rays, 52u * 64);
  EXPECT_GT(reduced_rays, 34u * 64);
  // Pairs of the same seed: 4 standard errors of their mean difference.
  const double error = std::sqrt((square - mean * mean) / (kSeeds - 1));
  EXPECT_LT(std::abs(mean), 4 * error);
  EXPECT_LT(error, 0.05 * full);
}

}  // namespace
}  // namespace probelab
