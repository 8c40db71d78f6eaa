// SPDX-License-Identifier: GPL-3.0-or-later
// The rungs of the error budget where the answer of each is known in closed form.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "budget_rungs.h"
#include "budget_score.h"
#include "ddgi/snapshot.h"
#include "scene_builders.h"

namespace probelab {
namespace {

constexpr double kPi = std::numbers::pi;

// Linear averages of plain interpolation, fp32 maps.
Params plainParams(const std::vector<std::string>& changes = {}) {
  Params params = loadParams("probelab");
  for (const char* change :
       {"irradiance_format=rgba32f", "moment_format=rg32f", "moment_encoding=raw", "rays=64",
        "average=linear", "crush=none", "normal_bias=0.0", "view_bias=0.0"})
    setParam(params, change);
  for (const std::string& change : changes) setParam(params, change);
  return params;
}

struct Estimated {
  BudgetEstimates rungs;
  std::vector<const RungEstimate*> all() const {
    return {&rungs.exact, &rungs.moments, &rungs.texels, &rungs.rays, &rungs.formats};
  }
};

// A lattice of `count` probes in `box`; bounds are the scene's.
Estimated estimateIn(const Scene& scene, const Box3f& box, const Vec3i& count, const Params& params,
                     const std::vector<QueryPoint>& points, const BudgetRays& rays = {2048, 64},
                     int updates = 4) {
  const EmbreeScene embree(scene);
  const Lattice lattice = makeLattice(box, count);
  const ProbeLayout layout = latticeLayout(
      lattice, scene.bounds,
      std::vector<uint8_t>(static_cast<std::size_t>(lattice.pointCount()), uint8_t{1}));
  const ProbeStates states = initialStates(layout);
  const BudgetField field{scene, embree, layout, states, params, 3, 1, updates};
  return {estimateBudget(field, rays, points)};
}

QueryPoint pointAt(const Vec3f& position, const Vec3f& normal) {
  return {position, normalize(normal), -normalize(normal)};
}

// Walls that emit 1 and reflect nothing: radiance 1 from everywhere, E = pi, whatever is finite.
TEST(BudgetRungs, AFurnaceIsExactOnEveryRung) {
  test::SceneBuilder builder;
  builder.box(Vec3f(-1), Vec3f(1), builder.material(Vec3f(0), Vec3f(1)), true);
  const Scene scene = builder.finish();
  const Box3f box{scene.bounds.min * 0.7f, scene.bounds.max * 0.7f};
  const std::vector<QueryPoint> points = {pointAt(Vec3f(0.2f, -0.3f, 0.1f), Vec3f(1, 2, -1)),
                                          pointAt(Vec3f(-0.6f, 0.6f, 0.6f), Vec3f(0, 0, 1))};
  for (const char* average : {"average=linear", "average=sqrt"}) {
    const Estimated e = estimateIn(scene, box, Vec3i(2), plainParams({average}), points);
    for (const RungEstimate* rung : e.all())
      for (std::size_t i = 0; i < points.size(); ++i) {
        EXPECT_NEAR(rung->first[i].x, kPi, 1e-5);
        EXPECT_NEAR(rung->second[i].z, kPi, 1e-5);
      }
    EXPECT_EQ(e.rungs.probes_read, 8u);
  }
}

// Albedo 0.5 and emission 1: radiance 2 from everywhere, by paths of any length. 4,096 rays a half
// count as 0.375 of them under a cosine, and a path's own deviation is below 1: five standard
// errors of the mean of both halves.
TEST(BudgetRungs, AFurnaceWithBouncesHoldsWithinTheNoiseOfItsPaths) {
  test::SceneBuilder builder;
  builder.box(Vec3f(-1), Vec3f(1), builder.material(Vec3f(0.5f), Vec3f(1)), true);
  const Scene scene = builder.finish();
  const Estimated e = estimateIn(scene, {scene.bounds.min * 0.5f, scene.bounds.max * 0.5f},
                                 Vec3i(2), plainParams({"rays=512"}),
                                 {pointAt(Vec3f(0.1f, 0, 0), Vec3f(0, 1, 0))}, {8192, 16}, 8);
  for (const RungEstimate* rung : e.all())
    EXPECT_NEAR((rung->first[0].x + rung->second[0].x) / 2, 2 * kPi,
                5 * kPi / std::sqrt(0.375 * 8192));
  EXPECT_NE(e.rungs.exact.first[0].x, e.rungs.exact.second[0].x);
}

// Under the sky 1 + b.d the irradiance is pi + 2 pi / 3 b.n at every point: only texels and finite
// rays can be wrong. Maps hold 1 + 2 / 3 b.t at the texels' directions t, read bilinearly.
class BudgetSky : public ::testing::Test {
 protected:
  const Vec3f slope_{0.5f, -0.3f, 0.7f};

  void SetUp() override {
    test::SceneBuilder builder;
    builder.scene().sky.radiance = Vec3f(1);
    builder.scene().sky.linear = slope_;
    builder.scene().bounds = {Vec3f(-1), Vec3f(1)};
    scene_ = builder.finish();
    for (const Vec3f& n : {Vec3f(0, 0, 1), Vec3f(0.3f, -0.5f, 0.8f), Vec3f(1, 0.1f, -0.4f),
                           Vec3f(-0.2f, 0.7f, -0.9f)})
      points_.push_back(pointAt(Vec3f(0.1f, 0.2f, -0.3f), n));
  }
  double smooth(const Vec3d& n) const { return kPi * (1 + 2.0 / 3 * dot(Vec3d(slope_), n)); }
  double texelled(const Vec3f& normal, int texels) const {
    const OctTaps<double> taps = octTaps(Vec3<double>(normal), texels, 0);
    const auto at = [&](int t) {
      return smooth(texelDirection<double>(t % texels, t / texels, texels));
    };
    const double fx = taps.fraction_x, fy = taps.fraction_y;
    return (at(taps.texel_00) * (1 - fx) + at(taps.texel_10) * fx) * (1 - fy) +
           (at(taps.texel_01) * (1 - fx) + at(taps.texel_11) * fx) * fy;
  }
  Scene scene_;
  std::vector<QueryPoint> points_;
};

TEST_F(BudgetSky, TexelsAddTheirKnownErrorAndNothingElse) {
  for (const char* border : {"border=true", "border=false"}) {
    // With a border, 8 stored texels are 6 of the map.
    const std::string texels = std::string("irradiance_texels=") + (border[7] == 't' ? "8" : "6");
    const Estimated e = estimateIn(scene_, scene_.bounds, Vec3i(2), plainParams({border, texels}),
                                   points_, {16384, 16});
    double largest = 0;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Vec3f& n = points_[i].normal;
      // A smooth integrand over 8,192 Fibonacci points: far below 1e-3.
      EXPECT_NEAR(e.rungs.exact.first[i].x, smooth(Vec3d(n)), 1e-3);
      EXPECT_NEAR(e.rungs.moments.second[i].x, smooth(Vec3d(n)), 1e-3);
      EXPECT_NEAR(e.rungs.texels.first[i].x, texelled(n, 6), 1e-3) << border;
      largest = std::max(largest, std::abs(texelled(n, 6) - smooth(Vec3d(n))));
    }
    EXPECT_GT(largest, 0.05);
  }
}

TEST_F(BudgetSky, FewRaysAreSeenInTheirRungAlone) {
  const Estimated few = estimateIn(scene_, scene_.bounds, Vec3i(2), plainParams({"rays=16"}),
                                   points_, {16384, 16}, 1);
  const Estimated many = estimateIn(scene_, scene_.bounds, Vec3i(2), plainParams({"rays=256"}),
                                    points_, {16384, 16}, 16);
  const auto off = [&](const Estimated& e) {
    double sum = 0;
    for (std::size_t i = 0; i < points_.size(); ++i)
      sum += std::abs(static_cast<double>(e.rungs.rays.first[i].x - e.rungs.texels.first[i].x));
    return sum;
  };
  EXPECT_GT(off(few), 0.02);
  EXPECT_LT(off(many), 0.1 * off(few));
  // No path: both estimates are the same rays.
  EXPECT_EQ(few.rungs.rays.first, few.rungs.rays.second);
}

TEST_F(BudgetSky, FormatsRoundByTheirLastPlace) {
  const Estimated e = estimateIn(scene_, scene_.bounds, Vec3i(2),
                                 plainParams({"irradiance_format=r11g11b10f"}), points_);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const auto stored = static_cast<double>(e.rungs.formats.first[i].x);
    const auto fine = static_cast<double>(e.rungs.rays.first[i].x);
    // Red has 6 bits behind the point: nearest is within 2^-7 of any value.
    EXPECT_NEAR(stored, fine, 0x1p-7 * fine);
    EXPECT_NE(stored, fine);
  }
}

// A wall between a lit and a dark room: traced visibility takes no light through it, moments do,
// and no visibility at all takes more.
class BudgetWall : public ::testing::Test {
 protected:
  void SetUp() override {
    test::SceneBuilder builder;
    const uint32_t dark = builder.material(Vec3f(0));
    const uint32_t lamp = builder.material(Vec3f(0), Vec3f(1));
    builder.box(Vec3f(-2, -1, -1), Vec3f(-0.05f, 1, 1), lamp, true);
    builder.box(Vec3f(0.05f, -1, -1), Vec3f(2, 1, 1), dark, true);
    scene_ = builder.finish();
    // Probes 0.5 m from the wall and farther; the point is between it and the next one.
    box_ = {Vec3f(-1.5f, -0.5f, -0.5f), Vec3f(1.5f, 0.5f, 0.5f)};
    points_ = {pointAt(Vec3f(0.2f, 0.1f, 0.1f), Vec3f(1, 0, 0))};
  }
  Scene scene_;
  Box3f box_;
  std::vector<QueryPoint> points_;
};

TEST_F(BudgetWall, TracedVisibilityLeaksNothingAndMomentsDo) {
  const Estimated e =
      estimateIn(scene_, box_, Vec3i(4, 2, 2), plainParams({"visibility_floor=0.1"}), points_);
  EXPECT_EQ(e.rungs.exact.first[0].x, 0);
  EXPECT_EQ(e.rungs.exact.second[0].x, 0);
  // The lit probes' share is 0.3, their facing at least 0.2, their visibility at least the floor of
  // 0.1; the dark ones' share is 0.7, their facing at most 1.2.
  EXPECT_GT(e.rungs.moments.first[0].x, kPi * 0.006 / 0.846);
  const Estimated open =
      estimateIn(scene_, box_, Vec3i(4, 2, 2), plainParams({"visibility=false"}), points_);
  EXPECT_EQ(open.rungs.exact.first[0].x, 0);
  EXPECT_GT(open.rungs.moments.first[0].x, 2 * e.rungs.moments.first[0].x);
}

// The moments of the lobe against a plane at distance h straight ahead: h (k + 1) / k and
// h^2 (k + 1) / (k - 1), and by them the weight of the far side of the wall.
TEST_F(BudgetWall, MomentsAreThoseOfTheVeryDirection) {
  // One lit probe and one dark one, in line with the point; no clamp in reach.
  const Box3f line{Vec3f(-0.55f, -0.1f, -0.1f), Vec3f(0.95f, 0.1f, 0.1f)};
  const double k = 200, lit_x = -0.55, point_x = 0.2, wall_x = -0.05;
  const std::vector<QueryPoint> points = {pointAt(Vec3f(0.2f, 0, 0), Vec3f(1, 0, 0))};
  const Estimated e =
      estimateIn(scene_, line, Vec3i(2, 1, 1),
                 plainParams({"facing=none", "trilinear=plain", "chebyshev_power=1.0",
                              "distance_clamp=4.0", "distance_exponent=200.0"}),
                 points, {1024, 4096});
  const double h = wall_x - lit_x, r = point_x - lit_x;
  const double mean = h * (k + 1) / k, square = h * h * (k + 1) / (k - 1);
  const double variance = square - mean * mean;
  const double weight = variance / (variance + (r - mean) * (r - mean));
  const double share = 0.5 * weight / (0.5 * weight + 0.5);
  // The lobe is cut off where 1e-4 of it is left, and that is far away.
  EXPECT_NEAR(e.rungs.moments.first[0].x, kPi * share, 0.03 * kPi * share);
}

TEST_F(BudgetWall, ThreadsAndOtherPointsChangeNoByte) {
  std::vector<QueryPoint> more = points_;
  more.push_back(pointAt(Vec3f(-1, 0.2f, 0), Vec3f(0, 1, 0)));
  std::vector<Vec3f> one;
  {
    const ThreadLimit limit(1);
    one = estimateIn(scene_, box_, Vec3i(4, 2, 2), plainParams(), points_).rungs.formats.first;
  }
  const Estimated two = estimateIn(scene_, box_, Vec3i(4, 2, 2), plainParams(), more);
  EXPECT_EQ(one[0], two.rungs.formats.first[0]);
}

// Errors of the two estimates that are opposite: their product has them, the mean has not.
TEST(BudgetScore, TheProductOfHalvesHasNoNoise) {
  Receivers receivers;
  RungEstimate estimate;
  for (int i = 0; i < 4; ++i) {
    Receiver r;
    r.position = Vec3f(static_cast<float>(i), 0, 0);
    r.area = 0.25;
    r.a = Vec3f(2.1f), r.b = Vec3f(1.9f);
    receivers.points.push_back(r);
    // Bias 0.5, and noise of either sign, independent of the other half's.
    estimate.first.push_back(Vec3f(2.5f + (i % 2 == 0 ? 0.4f : -0.4f)));
    estimate.second.push_back(Vec3f(2.5f + (i < 2 ? 0.4f : -0.4f)));
  }
  // (0.5 + noise -+ 0.1)(0.5 + noise +- 0.1) averages to 0.25 - 0.01; the truth's power is 3.99.
  EXPECT_NEAR(*budgetMeanSquare(estimate, receivers), 0.24 / 3.99, 1e-6);
  const BudgetRung rung = scoreRung("rung", "about", estimate, receivers);
  EXPECT_NEAR(*rung.nrmse, std::sqrt(0.24 / 3.99), 1e-6);
  // Differences of 0 and 0.8 in turn: sqrt(0.32 / 2) by the truth's root.
  EXPECT_NEAR(*rung.noise, std::sqrt(0.16 / 3.99), 1e-6);
  EXPECT_NEAR(*rung.report.all.bias, 0.25, 1e-6);
}

}  // namespace
}  // namespace probelab
