// SPDX-License-Identifier: GPL-3.0-or-later
// Parameters and presets, lattices, ray directions.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <set>

#include "base/error.h"
#include "base/files.h"
#include "ddgi/directions.h"
#include "ddgi/layout.h"
#include "ddgi/params.h"

namespace probelab {
namespace {

std::string messageOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Params, PresetsAreThePublishedNumbers) {
  const Params rtxgi = loadParams("rtxgi");
  EXPECT_EQ(rtxgi.irradiance_texels, 8);
  EXPECT_EQ(rtxgi.encoding_gamma, 5.0);
  EXPECT_EQ(rtxgi.chebyshev_power, 3.0);
  EXPECT_EQ(rtxgi.visibility_floor, 0.05);
  EXPECT_EQ(rtxgi.normal_bias, 0.04);  // 0.1 m at 2.5 m
  // 6 x 6 r11g11b10f and 16 x 16 rg16f: the talk's 1,168 bytes a probe.
  EXPECT_EQ(atlasBytesPerProbe(loadParams("gdc2019")), 1168u);
  EXPECT_EQ(atlasBytesPerProbe(rtxgi), 8u * 8 * 8 + 16 * 16 * 4);
  EXPECT_EQ(atlasBytesPerProbe(loadParams("classic")), 6u * 6 * 4);
}

TEST(Params, DescriptionLoadsAgain) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "described.toml";
  for (const std::string& preset : presetNames()) {
    const Params params = loadParams(preset);
    writeTextFile(path, describeParams(params));
    EXPECT_EQ(describeParams(loadParams(path.string())), describeParams(params));
  }
}

TEST(Params, FileStartsFromItsPreset) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "mine.toml";
  writeTextFile(path, "preset = \"gdc2019\"\nnormal_bias = 0.3\n");
  const Params params = loadParams(path.string());
  EXPECT_EQ(params.normal_bias, 0.3);
  EXPECT_EQ(params.average, PL_AVERAGE_SQRT_OF_WEIGHTED);
}

TEST(Params, ErrorsNameFileLineAndNearestKey) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "bad.toml";
  writeTextFile(path, "preset = \"rtxgi\"\n\nnormal_bais = 0.3\n");
  const std::string unknown = messageOf([&] { loadParams(path.string()); });
  EXPECT_NE(unknown.find("bad.toml:3: unknown parameter 'normal_bais'"), std::string::npos)
      << unknown;
  EXPECT_NE(unknown.find("did you mean 'normal_bias'?"), std::string::npos) << unknown;
  writeTextFile(path, "preset = \"rtxgi\"\nrays = -3\n");
  EXPECT_NE(
      messageOf([&] { loadParams(path.string()); }).find("bad.toml:2: rays is -3; it takes 1"),
      std::string::npos);
  writeTextFile(path, "rays = 3\n");
  EXPECT_NE(messageOf([&] { loadParams(path.string()); }).find("no value for ray_order"),
            std::string::npos);
  writeTextFile(path, "rays = = 3\n");
  EXPECT_NE(messageOf([&] { loadParams(path.string()); }).find("bad.toml:1"), std::string::npos);
  EXPECT_NE(messageOf([] { loadParams("rtxgl"); }).find("did you mean 'rtxgi'?"),
            std::string::npos);
}

TEST(Params, AssignmentsAreChecked) {
  Params params = loadParams("rtxgi");
  setParam(params, "irradiance_format=rgba32f");
  EXPECT_EQ(params.irradiance_format, PL_FORMAT_RGBA32F);
  setParam(params, "visibility=false");
  EXPECT_EQ(params.visibility, 0);
  EXPECT_EQ(params.name, "rtxgi irradiance_format=rgba32f visibility=false");
  for (const char* bad :
       {"rays", "rays=", "rays=1.5", "rays=0", "hysteresis=nan", "hysteresis=2", "facing=sideways",
        "visibility=1", "nothing=1", "rays=1\nrays=2", "hysteresis=0.5\nrays=3"})
    EXPECT_NE(messageOf([&] { setParam(params, bad); }), "no error") << bad;
}

TEST(Layout, LatticeSpansTheBoxAndOneLayerLiesInTheMiddle) {
  const Box3f box{Vec3f(-1, 0, 2), Vec3f(3, 1, 4)};
  const Lattice lattice = makeLattice(box, {3, 1, 2});
  EXPECT_EQ(lattice.position(0), Vec3f(-1, 0.5f, 2));
  EXPECT_EQ(lattice.position(5), Vec3f(3, 0.5f, 4));
  const ProbeLayout layout = latticeLayout(lattice, box, {1, 0, 1, 1, 1, 0});
  EXPECT_EQ(layout.positions.size(), 4u);
  EXPECT_EQ(layout.probe_of_point, (std::vector<int>{0, -1, 1, 2, 3, -1}));
  EXPECT_EQ(layout.bias_length_m, 2.0f);
  EXPECT_FLOAT_EQ(layout.support_radius_m, 3.0f);  // cell 2 x 1 x 2
}

TEST(Layout, UnusableOnesAreRefused) {
  const Box3f box{Vec3f(0), Vec3f(1)};
  const Lattice lattice = makeLattice(box, {2, 2, 2});
  const Params params = loadParams("rtxgi");
  const ProbeLayout none = latticeLayout(lattice, box, std::vector<uint8_t>(8, 0));
  EXPECT_NE(messageOf([&] { validateLayout(none, params); }).find("stores no probe"),
            std::string::npos);
  ProbeLayout coincident = latticeLayout(lattice, box, std::vector<uint8_t>(8, 1));
  coincident.bias_length_m = 0;
  EXPECT_NE(messageOf([&] { validateLayout(coincident, params); }).find("coincide"),
            std::string::npos);
}

TEST(Directions, FibonacciPointsAreUnitAndBalanced) {
  for (const int n : {1, 32, 1000}) {
    Vec3d sum;
    for (const Vec3d& p : sphericalFibonacci(n)) {
      EXPECT_NEAR(length(p), 1, 1e-14);
      sum += p;
    }
    if (n >= 32) {
      EXPECT_LT(length(sum) / n, 0.01);
    }
  }
}

// Uniform rotations: a rotated vector has mean 0 and second moment 1/3 on each axis. Four standard
// errors of n samples with variances 1/3 and 4/45.
TEST(Directions, RotationsAreUniform) {
  const int n = 20000;
  const Vec3d v = normalize(Vec3d(1, 2, 3));
  Vec3d mean, square;
  double cross_xy = 0;
  for (int i = 0; i < n; ++i) {
    const auto rows = randomRotation(5, static_cast<uint64_t>(i));
    const Vec3d r(dot(rows[0], v), dot(rows[1], v), dot(rows[2], v));
    ASSERT_NEAR(length(r), 1, 1e-12);
    mean += r / static_cast<double>(n);
    square += r * r / static_cast<double>(n);
    cross_xy += r.x * r.y / n;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(mean[axis], 0, 4 * std::sqrt(1.0 / 3 / n));
    EXPECT_NEAR(square[axis], 1.0 / 3, 4 * std::sqrt(4.0 / 45 / n));
  }
  EXPECT_NEAR(cross_xy, 0, 4 * std::sqrt(1.0 / 15 / n));
}

TEST(Directions, AreAFunctionOfSeedAndUpdate) {
  EXPECT_EQ(updateDirections(16, 1, 2), updateDirections(16, 1, 2));
  EXPECT_NE(updateDirections(16, 1, 2), updateDirections(16, 1, 3));
  EXPECT_NE(updateDirections(16, 1, 2), updateDirections(16, 2, 2));
}

}  // namespace
}  // namespace probelab
