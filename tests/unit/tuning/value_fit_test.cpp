// SPDX-License-Identifier: GPL-3.0-or-later
// Texels fitted through the query, against known texels and a dense solve of the same problem,
// whose matrix comes from queries with one texel raised.
#include "tuning/value_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <map>

#include "base/error.h"
#include "scattered_helpers.h"

namespace probelab {
namespace {

Params fitParams(const std::vector<std::string>& changes = {}) {
  Params params = loadParams("rtxgi");
  for (const char* change : {"encoding_gamma=1.0", "average=linear", "irradiance_texels=6",
                             "moment_texels=6", "irradiance_format=rgba32f"})
    setParam(params, change);
  for (const std::string& change : changes) setParam(params, change);
  return params;
}

const Box3f kBounds{Vec3f(-2), Vec3f(2)};

// A border's texels repeat those inside.
void fillBorders(FieldSnapshot& field) {
  const int n = field.lattice.irradiance_texels, side = n + 2 * field.lattice.border;
  for (std::size_t p = 0; p < field.positions.size(); ++p)
    for (int y = -1; field.lattice.border != 0 && y <= n; ++y)
      for (int x = -1; x <= n; ++x) {
        const int inner = tileTexel(x, y, n, 0);
        const auto tile = p * static_cast<std::size_t>(side * side);
        field.irradiance[tile + static_cast<std::size_t>((y + 1) * side + x + 1)] =
            field.irradiance[tile +
                             static_cast<std::size_t>((inner / n + 1) * side + inner % n + 1)];
      }
}

FieldSnapshot randomField(const Params& params, bool scattered, uint64_t seed = 1) {
  const ProbeLayout layout = scattered
                                 ? test::randomScattered(kBounds, 12, Vec3i(3, 4, 3), kBounds, 2)
                                 : latticeLayout(makeLattice(kBounds, Vec3i(2, 3, 2)), kBounds,
                                                 std::vector<uint8_t>(12, uint8_t{1}));
  FieldSnapshot field = layoutSnapshot(layout, initialStates(layout), params);
  test::fillTexels(field, seed);
  fillBorders(field);
  return field;
}

Vec3d answer(const FieldSnapshot& field, const Params& params, const Receiver& r) {
  return querySnapshot(field, queryParams(params), {r.position, r.normal, r.view}).irradiance;
}

// Receivers of unequal area at random places, with what `truth` answers there.
Receivers receiversOf(const FieldSnapshot& truth, const Params& params, int count,
                      uint64_t seed = 7) {
  Receivers receivers;
  receivers.scene_path = "test.gltf";
  for (const QueryPoint& q : test::randomQueries(kBounds, count, seed)) {
    Receiver r;
    r.position = q.position, r.normal = q.normal, r.view = q.view;
    r.area = 1 + receivers.points.size() % 3;
    r.split = Split::train;
    r.a = r.b = Vec3f(answer(truth, params, r));
    receivers.points.push_back(r);
  }
  return receivers;
}

FieldSnapshot withTexels(FieldSnapshot field, std::vector<Vec3f> texels) {
  field.irradiance = std::move(texels);
  return field;
}

// 60 receivers and 432 texels: with next to no pull the truth is met, however the query averages.
TEST(ValueFit, TruthFromOtherTexelsIsMetAtTheReceivers) {
  for (const bool scattered : {false, true})
    for (const std::vector<std::string>& changes : std::vector<std::vector<std::string>>{
             {},
             {"border=false"},
             {"average=sqrt"},
             {"average=sqrt_of_weighted", "fallback=lerp_unoccluded"},
             {"encoding_gamma=5.0", "average=sqrt"}}) {
      const Params params = fitParams(changes);
      const FieldSnapshot traced = randomField(params, scattered);
      const Receivers receivers = receiversOf(randomField(params, scattered, 9), params, 60);
      const ValueFit fit = fitValues(traced, receivers, Split::train, params,
                                     {.pull = 1e-6, .smoothness = 0});
      const std::string what = ::testing::PrintToString(changes);
      EXPECT_GT(fit.train_before, 0.05) << what;
      EXPECT_LT(fit.train_after, 1e-3) << what;
      EXPECT_EQ(fit.linearisations == 1, params.average == PL_AVERAGE_LINEAR) << what;
      const FieldSnapshot fitted = withTexels(traced, fit.irradiance);
      for (const Receiver& r : receivers.points) {
        const Vec3d error = answer(fitted, params, r) - Vec3d(r.a);
        EXPECT_LT(length(error), 0.01 * length(Vec3d(r.a))) << what;
      }
    }
}

// What the fit must minimise, written anew: a dense matrix of what one texel more does to each
// query, and the priors of the header.
struct DenseProblem {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd right, scale, traced;
  std::vector<std::size_t> stored;  // [unknown]
};

DenseProblem denseProblem(const FieldSnapshot& field, const Params& params,
                          const Receivers& receivers, const ValueFitSettings& settings) {
  const int n = field.lattice.irradiance_texels, border = field.lattice.border;
  const auto per_probe = static_cast<std::size_t>((n + 2 * border) * (n + 2 * border));
  DenseProblem dense;
  std::vector<std::pair<int, int>> pairs;
  for (std::size_t p = 0; p < field.positions.size(); ++p)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) {
        const auto k = static_cast<int>(dense.stored.size());
        dense.stored.push_back(
            p * per_probe + static_cast<std::size_t>((y + border) * (n + 2 * border) + x + border));
        if (x > 0) pairs.emplace_back(k - 1, k);
        if (y > 0) pairs.emplace_back(k - n, k);
        // Across a seam the map goes on mirrored along the edge.
        const int mirror_y = k - y * n + (n - 1 - y) * n, mirror_x = k - x + (n - 1 - x);
        if ((x == 0 || x == n - 1) && y < n / 2) pairs.emplace_back(k, mirror_y);
        if ((y == 0 || y == n - 1) && x < n / 2) pairs.emplace_back(k, mirror_x);
      }
  const auto unknowns = static_cast<Eigen::Index>(dense.stored.size());
  dense.traced.resize(unknowns);
  for (Eigen::Index k = 0; k < unknowns; ++k)
    dense.traced[k] = field.irradiance[dense.stored[static_cast<std::size_t>(k)]].y;
  dense.scale = dense.traced.array() + settings.floor * dense.traced.mean();
  double area = 0, power = 0, squares = 0;
  for (const Receiver& r : receivers.points) area += r.area;
  for (const Receiver& r : receivers.points) {
    power += r.area / area * static_cast<double>(r.a.y) * static_cast<double>(r.b.y);
    squares += r.area / area * r.area / area;
  }
  dense.matrix = Eigen::MatrixXd::Zero(unknowns, unknowns);
  dense.right = Eigen::VectorXd::Zero(unknowns);
  FieldSnapshot raised = field;
  for (const Receiver& r : receivers.points) {
    const double base = answer(field, params, r).y;
    Eigen::VectorXd slopes(unknowns);
    for (Eigen::Index k = 0; k < unknowns; ++k) {
      Vec3f& texel = raised.irradiance[dense.stored[static_cast<std::size_t>(k)]];
      const float before = texel.y;
      texel.y = before + 1;
      fillBorders(raised);
      slopes[k] = (answer(raised, params, r).y - base) * dense.scale[k] /
                  (static_cast<double>(before + 1) - static_cast<double>(before));
      texel.y = before;
    }
    fillBorders(raised);
    const double weight = r.area / area / power;
    dense.matrix += weight * slopes * slopes.transpose();
    dense.right += weight * (0.5 * static_cast<double>(r.a.y + r.b.y) - base) * slopes;
  }
  for (Eigen::Index k = 0; k < unknowns; ++k) dense.matrix(k, k) += settings.pull * squares;
  for (const auto& [i, j] : pairs) {
    const double s = settings.smoothness * squares;
    dense.matrix(i, i) += s, dense.matrix(j, j) += s;
    dense.matrix(i, j) -= s, dense.matrix(j, i) -= s;
  }
  return dense;
}

TEST(ValueFit, AgreesWithADenseSolve) {
  for (const bool scattered : {false, true})
    for (const char* border : {"border=true", "border=false"}) {
      const Params params = fitParams({border, "irradiance_texels=4"});
      const FieldSnapshot traced = randomField(params, scattered);
      const Receivers receivers = receiversOf(randomField(params, scattered, 9), params, 150);
      const ValueFitSettings settings{.pull = 0.5, .smoothness = 1.5, .floor = 0.2};
      const DenseProblem dense = denseProblem(traced, params, receivers, settings);
      const Eigen::VectorXd d = dense.matrix.ldlt().solve(dense.right);
      const ValueFit fit = fitValues(traced, receivers, Split::train, params, settings);
      ASSERT_EQ(fit.texels, dense.stored.size());
      double moved = 0;
      for (Eigen::Index k = 0; k < d.size(); ++k) {
        const double wanted = dense.traced[k] + dense.scale[k] * d[k];
        ASSERT_GT(wanted, 0);  // no bound is met
        // fp32 texels, and slopes from fp32 texels that are 1 apart.
        EXPECT_NEAR(fit.irradiance[dense.stored[static_cast<std::size_t>(k)]].y, wanted, 2e-5);
        moved = std::max(moved, std::abs(dense.scale[k] * d[k]));
      }
      EXPECT_GT(moved, 0.1);
    }
}

// Half of the receivers are black: texels stop at 0, and there the cost would fall only below 0.
TEST(ValueFit, TexelsStopAtZeroWhereTheCostWouldFallBelow) {
  const Params params = fitParams({"irradiance_texels=4", "border=false"});
  const FieldSnapshot traced = randomField(params, false);
  Receivers receivers = receiversOf(traced, params, 150);
  for (Receiver& r : receivers.points) r.a = r.b = r.position.x < 0 ? Vec3f(0) : r.a * 3.0f;
  const ValueFitSettings settings{.pull = 0.02, .smoothness = 0.02};
  const ValueFit fit = fitValues(traced, receivers, Split::train, params, settings);
  const DenseProblem dense = denseProblem(traced, params, receivers, settings);
  Eigen::VectorXd d(dense.scale.size());
  for (Eigen::Index k = 0; k < d.size(); ++k) {
    const double value = fit.irradiance[dense.stored[static_cast<std::size_t>(k)]].y;
    ASSERT_GE(value, 0);
    d[k] = (value - dense.traced[k]) / dense.scale[k];
  }
  const Eigen::VectorXd slope = dense.matrix * d - dense.right;
  const double unit = dense.right.cwiseAbs().maxCoeff();
  int at_zero = 0;
  for (Eigen::Index k = 0; k < d.size(); ++k) {
    const bool zero = fit.irradiance[dense.stored[static_cast<std::size_t>(k)]].y == 0;
    at_zero += zero ? 1 : 0;
    if (zero)
      EXPECT_GT(slope[k], -1e-5 * unit);
    else
      EXPECT_NEAR(slope[k], 0, 1e-5 * unit);  // fp32 texels
  }
  EXPECT_GT(at_zero, 10);
  EXPECT_LT(at_zero, d.size() / 2 + 20);
}

TEST(ValueFit, AStrongPullGivesTheTracedTexels) {
  const Params params = fitParams();
  const FieldSnapshot traced = randomField(params, false);
  const Receivers receivers = receiversOf(randomField(params, false, 9), params, 100);
  const ValueFit fit = fitValues(traced, receivers, Split::train, params, {.pull = 1e9});
  for (std::size_t i = 0; i < traced.irradiance.size(); ++i)
    EXPECT_NEAR(length(fit.irradiance[i] - traced.irradiance[i]), 0, 1e-6);
  EXPECT_NEAR(fit.train_after, fit.train_before, 1e-6);
}

// All receivers in one cell of a lattice of 5 x 3 x 2: probes of other cells keep their bits, and
// so does a channel without light.
TEST(ValueFit, WhatNoReceiverReadsKeepsItsValue) {
  const Params params = fitParams({"normal_bias=0.0", "view_bias=0.0"});
  const Lattice lattice = makeLattice(kBounds, Vec3i(5, 3, 2));
  const ProbeLayout layout = latticeLayout(lattice, kBounds, std::vector<uint8_t>(30, uint8_t{1}));
  FieldSnapshot field = layoutSnapshot(layout, initialStates(layout), params);
  test::fillTexels(field, 3);
  fillBorders(field);
  Receivers receivers = receiversOf(field, params, 400);
  std::erase_if(receivers.points,
                [](const Receiver& r) { return r.position.x > -1 || r.position.y > 0; });
  ASSERT_GT(receivers.points.size(), 20u);
  for (Receiver& r : receivers.points) r.a = r.b = Vec3f(2 * r.a.x, 0, r.a.z / 2);
  const ValueFit fit = fitValues(field, receivers, Split::train, params, {});
  const std::size_t tile = field.irradiance.size() / 30;
  for (std::size_t i = 0; i < field.irradiance.size(); ++i) {
    const Vec3f& at = field.positions[i / tile];
    if (at.x > -0.9f || at.y > 0.1f)
      EXPECT_EQ(fit.irradiance[i], field.irradiance[i]);
    else
      EXPECT_NE(fit.irradiance[i].x, field.irradiance[i].x);
    EXPECT_EQ(fit.irradiance[i].y, field.irradiance[i].y);
  }
  EXPECT_EQ(fit.texels, 8u * 16u);
}

TEST(ValueFit, HeldOutReceiversDoNotCount) {
  const Params params = fitParams();
  const FieldSnapshot traced = randomField(params, true);
  Receivers receivers = receiversOf(randomField(params, true, 9), params, 80);
  const ValueFit alone = fitValues(traced, receivers, Split::train, params, {});
  const Receivers more = receiversOf(randomField(params, true, 10), params, 50, 8);
  for (Receiver r : more.points) {
    r.split = Split::heldout;
    receivers.points.push_back(r);
  }
  EXPECT_EQ(fitValues(traced, receivers, Split::train, params, {}).irradiance, alone.irradiance);
}

TEST(ValueFit, WhatCannotBeFittedIsSaid) {
  const Params params = fitParams();
  const FieldSnapshot field = randomField(params, false);
  Receivers receivers = receiversOf(field, params, 20);
  const auto fit = [&](Split split, const Params& with, const ValueFitSettings& settings) {
    fitValues(field, receivers, split, with, settings);
  };
  EXPECT_THROW(fit(Split::heldout, params, {}), InputError);
  EXPECT_THROW(fit(Split::train, fitParams({"irradiance_texels=8"}), {}), InputError);
  EXPECT_THROW(fit(Split::train, fitParams({"fallback=nearest"}), {}), InputError);
  EXPECT_THROW(fit(Split::train, params, {.pull = 0}), InputError);
  EXPECT_THROW(fit(Split::train, params, {.smoothness = -1}), InputError);
  for (Receiver& r : receivers.points) r.a = r.b = Vec3f(0);
  EXPECT_THROW(fit(Split::train, params, {}), InputError);
}

TEST(TransferGains, GoToAnotherLightPerChannelAndZerosStay) {
  const std::vector<Vec3f> traced = {Vec3f(1, 2, 0), Vec3f(4, 0, 1)};
  const std::vector<Vec3f> fitted = {Vec3f(2, 1, 5), Vec3f(4, 3, 0)};
  const std::vector<Vec3f> other = {Vec3f(10, 10, 10), Vec3f(0, 7, 3)};
  const std::vector<Vec3f> gained = transferGains(traced, fitted, other);
  EXPECT_EQ(gained[0], Vec3f(20, 5, 10));
  EXPECT_EQ(gained[1], Vec3f(0, 7, 0));
}

}  // namespace
}  // namespace probelab
