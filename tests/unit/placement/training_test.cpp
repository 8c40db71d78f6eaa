// SPDX-License-Identifier: GPL-3.0-or-later
// What strategies learn from, against path tracing and closed forms; the search's bookkeeping
// against doing everything anew; the fit of weights.
#include "placement/training.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "placement/maxent.h"
#include "placement/pool.h"
#include "placement/reading_bound.h"
#include "placement/subset_model.h"
#include "placement/weight_fit.h"
#include "path_truth.h"
#include "places.h"

namespace probelab::test {
namespace {

// Coloured walls, a lamp, a glowing panel and a sky behind a missing wall.
Scene mixedLights() {
  SceneBuilder b;
  const uint32_t white = b.material(Vec3f(0.7f)), red = b.material(Vec3f(0.7f, 0.2f, 0.1f));
  const uint32_t panel = b.material(Vec3f(0.2f), Vec3f(3, 2, 1));
  b.quad({0, 0, 0}, {0, 0, 4}, {4, 0, 4}, {4, 0, 0}, white);
  b.quad({0, 3, 0}, {4, 3, 0}, {4, 3, 4}, {0, 3, 4}, white);
  b.quad({0, 0, 0}, {0, 3, 0}, {0, 3, 4}, {0, 0, 4}, red);
  b.quad({4, 0, 0}, {4, 0, 4}, {4, 3, 4}, {4, 3, 0}, white);
  b.quad({0, 0, 0}, {4, 0, 0}, {4, 3, 0}, {0, 3, 0}, white);
  b.quad({1, 2.9f, 1}, {2, 2.9f, 1}, {2, 2.9f, 2}, {1, 2.9f, 2}, panel);
  b.pointLight({3, 1.2f, 1}, Vec3f(4));
  b.camera({2, 1.5f, 3}, {2, 1, 0});
  b.scene().sky.radiance = Vec3f(0.4f, 0.5f, 0.7f);
  b.scene().bounds = {{-0.1f, -0.1f, -0.1f}, {4.1f, 3.1f, 4.2f}};
  return b.finish();
}

struct Trained {
  explicit Trained(Scene scene, int receivers = 600, int lights = 0)
      : place(std::move(scene)),
        training(place.scene, place.embree, place.reachability,
                 TrainingSettings{receivers, lights, Split::train, 3}) {}
  Place place;
  Training training;
};

TEST(Training, TruthIsWhatPathsFind) {
  Trained t(mixedLights());
  const Training::Data& data = t.training.data();
  ASSERT_EQ(data.stateCount(), 1u);
  const TruthAgainstPaths found = againstPaths(data, t.place.scene, t.place.embree);
  // 256 stratified rays a point leave about 3 % each, a tenth of that in the mean of 600.
  EXPECT_NEAR(found.ratio, 1, 0.01);
  EXPECT_LT(found.nrmse, 0.05);
}

TEST(Training, AFurnaceIsUniformAndEveryLayoutIsRightInIt) {
  // E / pi = Le / (1 - albedo) = 2 in a closed box.
  SceneBuilder b;
  b.box({0, 0, 0}, {3, 3, 3}, b.material(Vec3f(0.5f), Vec3f(1)), true);
  b.camera({1.5f, 1.5f, 1.5f}, {2, 1.5f, 1.5f});
  Trained t(b.finish());
  const Training::Data& data = t.training.data();
  for (const float e : data.truth) EXPECT_NEAR(e, 2, 0.02);
  const ProbeLayout layout = placeProbes("grid", t.place.input(27, 1, {}));
  EXPECT_LT(t.training.score(layout, t.place.params), 0.005);
  EXPECT_EQ(t.training.evaluations(), 1u);
}

Scene glowingBox(float albedo, float radiance) {
  SceneBuilder b;
  b.box({0, 0, 0}, {3, 3, 3}, b.material(Vec3f(albedo), Vec3f(radiance)), true);
  b.camera({1.5f, 1.5f, 1.5f}, {2, 1.5f, 1.5f});
  return b.finish();
}

TEST(Training, BouncesOfBrightWallsSettle) {
  // E / pi = Le / (1 - albedo); the hundredth bounce still brings 0.6 %.
  Trained t(glowingBox(0.95f, 0.05f), 64);
  for (const float e : t.training.data().truth) EXPECT_NEAR(e, 1, 2e-3);
}

TEST(Training, BouncesWithoutEndAreAnError) {
  Trained t(glowingBox(1, 1), 8);
  EXPECT_THROW(t.training.data(), InputError);
}

// The mean of the first state: a lamp of 1 cd in a bright room, with another in the dark one beside
// it switched off; in the second that one has `other_cd` and the first is off.
double dimMean(float other_cd) {
  SceneBuilder b;
  b.box({-3.05f, 0, 0}, {-0.05f, 3, 3}, b.material(Vec3f(0.9f)), true);
  b.box({0.05f, 0, 0}, {3.05f, 3, 3}, b.material(Vec3f(0.05f)), true);
  b.pointLight({-1.5f, 2, 1.5f}, Vec3f(1));
  b.pointLight({1.5f, 2, 1.5f}, Vec3f(1));
  b.camera({-1, 1, 1}, {-2, 1, 2});
  b.camera({1, 1, 1}, {2, 1, 2});
  Scene scene = b.finish();
  scene.lights[0].name = "west", scene.lights[1].name = "east";
  const auto state = [](const char* name, float west, float east) {
    return LightingState{
        name, Split::train, {{.light = "west", .intensity = west}, {.light = "east", .intensity = east}}};
  };
  scene.states = {state("dim", 1, 0), state("bright", 0, other_cd)};
  Trained t(std::move(scene), 200);
  return t.training.data().mean.front();
}

TEST(Training, ADimStateSettlesBesideABrightOne) {
  const double alone = dimMean(0);
  EXPECT_GT(alone, 0);
  EXPECT_NEAR(dimMean(1e5f) / alone, 1, 2e-3);
}

TEST(Training, EveryGeneratedLightLightsTheRoom) {
  Trained t(pillarRoom(), 200, 6);
  const Training::Data& data = t.training.data();
  EXPECT_EQ(data.stateCount(), 7u);
  for (const double mean : data.mean) EXPECT_GT(mean, 0);
  for (const Receiver& r : data.receivers) EXPECT_EQ(r.split, Split::train);
}

// What the minimum demands: shares are prior exp(multiplier . offset) up to a factor, and their
// centroid is off by the stiffness, 0.01, times the multiplier, which has 3 numbers for 14 shares.
TEST(Maxent, SharesAreTheMinimum) {
  Rng rng(5, RngStream::test);
  for (int trial = 0; trial < 200; ++trial) {
    constexpr int kPoints = 14;
    std::vector<Vec3f> offsets;
    std::vector<float> priors, shares(kPoints);
    for (int i = 0; i < kPoints; ++i) {
      offsets.push_back(
          Vec3f(rng.nextFloat() - 0.5f, rng.nextFloat() - 0.5f, rng.nextFloat() - 0.4f) * 1.1f);
      priors.push_back(maxentPrior(length(offsets.back()), 3));
    }
    maxentShares(offsets, priors, shares);
    Eigen::MatrixXd terms(kPoints, 4);
    Eigen::VectorXd logs(kPoints);
    Eigen::Vector3d mean(0, 0, 0);
    double sum = 0;
    for (int i = 0; i < kPoints; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const Eigen::Vector3d d(offsets[at].x, offsets[at].y, offsets[at].z);
      terms.row(i) << d.transpose(), 1.0;
      logs[i] = std::log(static_cast<double>(shares[at]) / static_cast<double>(priors[at]));
      mean += d * static_cast<double>(shares[at]);
      sum += static_cast<double>(shares[at]);
    }
    EXPECT_NEAR(sum, 1, 1e-5);
    const Eigen::Vector4d solution = terms.colPivHouseholderQr().solve(logs);
    EXPECT_LT((terms * solution - logs).norm(), 1e-3);
    EXPECT_LT((mean + 0.01 * solution.head<3>()).norm(), 1e-3);
  }
}

TEST(Maxent, SharesOfACellsCornersAreTrilinear) {
  std::vector<Vec3f> offsets;
  const Vec3f at(0.3f, 0.45f, 0.6f);
  for (int i = 0; i < 8; ++i)
    offsets.push_back((Vec3f(i & 1 ? 1.0f : 0.0f, i & 2 ? 1.0f : 0.0f, i & 4 ? 1.0f : 0.0f) - at));
  std::vector<float> priors(8, 1.0f), shares(8);
  maxentShares(offsets, priors, shares);
  for (std::size_t i = 0; i < 8; ++i) {
    const float x = i & 1 ? at.x : 1 - at.x, y = i & 2 ? at.y : 1 - at.y,
                z = i & 4 ? at.z : 1 - at.z;
    EXPECT_NEAR(shares[i], x * y * z, 0.015f) << i;  // the stiffness again
  }
}

struct Searched : Trained {
  Searched() : Trained(pillarRoom(), 300, 3) {
    const Training::Data& data = training.data();
    judged = trainPoints(data);
    addPool(judged, data, {.points = 100, .share = 0.5, .spacing_m = 1}, 4);
    objective.state_weights.assign(data.stateCount(), 1.0 / static_cast<double>(data.stateCount()));
    const FreeSpace space(input);
    Rng rng(9, RngStream::test);
    std::vector<Vec3f> positions;
    for (int i = 0; i < 60; ++i) positions.push_back(space.sample(rng));
    probes = bakeProbes(*data.patches, plan, positions);
  }
  SubsetModel model() { return {training.data(), judged, place.params, plan, settings, objective}; }
  PlacementInput input = place.input(24);
  BakePlan plan = makeBakePlan(place.params, kSearchRays, 3.0f, 1);
  SubsetSettings settings = {.neighbours = 6, .bias_length_m = 1, .largest_reach_m = 3};
  JudgedPoints judged;
  Objective objective;
  std::vector<BakedProbe> probes;
};

TEST(SubsetModel, ChangesLeaveWhatAFreshModelHas) {
  Searched s;
  SubsetModel model = s.model();
  std::vector<std::pair<int, std::size_t>> in;  // index in the model, in s.probes
  Rng rng(2, RngStream::test);
  for (std::size_t i = 0; i < 30; ++i) in.emplace_back(model.add(s.probes[i]), i);
  for (std::size_t i = 30; i < 60; ++i) {
    const std::size_t out = rng.nextBelow(in.size());
    const SubsetModel::Change change{in[out].first, &s.probes[i]};
    const double before = model.cost(), expected = model.tryChange(change);
    model.remove(in[out].first);
    in[out] = {model.add(s.probes[i]), i};
    EXPECT_NEAR(model.cost() - before, expected, 1e-5 * before) << i;
  }
  SubsetModel fresh = s.model();
  for (const auto& [index, probe] : in) fresh.add(s.probes[probe]);
  EXPECT_NEAR(fresh.cost(), model.cost(), 1e-5 * model.cost());
  EXPECT_LT(model.cost(), 1);  // 1: as bad as no probe at all
}

TEST(SubsetModel, WhatAChangeDoesNotTouchKeepsItsCost) {
  Searched s;
  SubsetModel model = s.model();
  for (std::size_t i = 0; i < 30; ++i) model.add(s.probes[i]);
  const SubsetModel::Change change{model.probes()[7], &s.probes[40]};
  const std::vector<uint32_t> touched = model.touched(change);
  std::vector<double> before;
  for (std::size_t r = 0; r < model.receiverCount(); ++r) before.push_back(model.costAt(r));
  model.remove(change.removed);
  model.add(s.probes[40]);
  for (std::size_t r = 0; r < model.receiverCount(); ++r)
    if (!std::ranges::binary_search(touched, static_cast<uint32_t>(r)))
      EXPECT_NEAR(model.costAt(r), before[r], 1e-6 * before[r] + 1e-12) << r;
}

TEST(WeightFit, LowersTheErrorAndStaysWhenItIsStiff) {
  Searched s;
  const ProbeLayout start =
      placeProbes("poisson", s.place.input(24, 1, resolveOptions(findStrategy("poisson"), {})));
  const CornerWeights given = cornerWeights(start.influence);
  const auto fittedTo = [&](const JudgedPoints& judged, double stiffness) {
    const CornerWeights weights =
        fitWeights(s.training.data(), judged, start, given, {}, s.place.params, s.objective,
                   {.iterations = 60, .stiffness = stiffness});
    return scatteredLayout(Interpolant::fitted, start.positions, s.place.scene.bounds,
                           start.influence.corners, weights);
  };
  const auto fitted = [&](double stiffness) { return fittedTo(s.judged, stiffness); };
  const double before = s.training.score(start, s.place.params);
  const double after = s.training.score(fitted(0.01), s.place.params);
  EXPECT_LT(after, 0.9 * before);
  // One point that looks into a lamp, whatever its brightness, does not carry the others away.
  JudgedPoints glaring = s.judged;
  const std::size_t states = s.training.data().stateCount();
  for (std::size_t l = 0; l < states; ++l) glaring.truth[l] *= 1e4f;
  EXPECT_LT(s.training.score(fittedTo(glaring, 0.01), s.place.params), 1.1 * after);
  // With no freedom only the floor of the weights remains, 1e-4 of a corner's sum.
  EXPECT_NEAR(s.training.score(fitted(1e9), s.place.params), before, 0.01 * before);
}

}  // namespace
}  // namespace probelab::test
