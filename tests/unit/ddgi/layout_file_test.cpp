// SPDX-License-Identifier: GPL-3.0-or-later
// Layout files: what is written comes back bit for bit; what does not fit is refused by name.
#include <gtest/gtest.h>

#include <bit>
#include <filesystem>

#include "base/error.h"
#include "base/files.h"
#include "ddgi/layout_file.h"
#include "scattered_helpers.h"
#include "scene_builders.h"

namespace probelab {
namespace {

// A room far from the world's origin, where adding it and taking it away loses bits.
Scene room() {
  test::SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(4, 3, 2), builder.material(Vec3f(0.5f), Vec3f(1)), true);
  Scene scene = builder.finish();
  scene.path = "room.toml";
  scene.content_hash = "0123";
  scene.origin = Vec3d(1e9 / 3, -0.1, 7e5 + 1.0 / 7);
  return scene;
}

ProbeLayout scattered(const Scene& scene) {
  ProbeLayout layout = test::randomScattered(scene.bounds, 30, Vec3i(5, 4, 4), scene.bounds, 1);
  layout.positions[3] = Vec3f(1e-20f, -0.0f, 1.0f / 3);
  layout.positions[4] = Vec3f(0.1f, 1e-7f, 2);
  layout.pinned.assign(30, 0);
  layout.pinned[7] = 1;
  layout.interpolant = Interpolant::fitted;
  layout.strategy = "optimized";
  layout.asked = 32;
  layout.seed = 0xfedcba9876543210u;
  layout.options = {{"lights", "6"}, {"start", "\"grid\"\n"}};
  layout.evaluations = 12345;
  layout.build_s = 1.0 / 3;
  return layout;
}

ProbeLayout lattice(const Scene& scene) {
  const Lattice points = makeLattice({Vec3f(0.1f), Vec3f(3.7f, 2.9f, 1.9f)}, Vec3i(4, 1, 3));
  ProbeLayout layout = latticeLayout(points, scene.bounds, {1, 1, 0, 1, 1, 1, 1, 0, 1, 1, 1, 1});
  layout.strategy = "grid";
  return layout;
}

class LayoutFile : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::path(::testing::TempDir()) /
            (std::string("layout_file_") + info->name() + ".json");
  }
  void TearDown() override { std::filesystem::remove(path_); }
  ProbeLayout roundTrip(const ProbeLayout& layout, const Scene& scene) {
    writeLayout(path_, layout, scene);
    return readLayout(path_, scene);
  }
  // The message of the refusal, "" where the file is read.
  std::string refusal(const std::string& text, const Scene& scene) {
    writeTextFile(path_, text);
    try {
      readLayout(path_, scene);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  std::filesystem::path path_;
};

void expectSameBits(const Vec3f& a, const Vec3f& b) {
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(std::bit_cast<uint32_t>(a[i]), std::bit_cast<uint32_t>(b[i])) << a[i] << " " << b[i];
}

void expectSame(const ProbeLayout& a, const ProbeLayout& b) {
  EXPECT_EQ(a.strategy, b.strategy);
  EXPECT_EQ(a.interpolant, b.interpolant);
  expectSameBits(a.bounds.min, b.bounds.min);
  expectSameBits(a.bounds.max, b.bounds.max);
  ASSERT_EQ(a.positions.size(), b.positions.size());
  for (std::size_t i = 0; i < a.positions.size(); ++i)
    expectSameBits(a.positions[i], b.positions[i]);
  ASSERT_EQ(a.lengths.size(), b.lengths.size());
  for (std::size_t i = 0; i < a.lengths.size(); ++i) {
    EXPECT_EQ(a.lengths[i].bias, b.lengths[i].bias);
    EXPECT_EQ(a.lengths[i].support, b.lengths[i].support);
  }
  EXPECT_EQ(a.pinned, b.pinned);
  EXPECT_EQ(a.bias_length_m, b.bias_length_m);
  EXPECT_EQ(a.support_radius_m, b.support_radius_m);
  EXPECT_EQ(a.asked, b.asked);
  EXPECT_EQ(a.seed, b.seed);
  EXPECT_EQ(a.options, b.options);
  EXPECT_EQ(a.evaluations, b.evaluations);
  EXPECT_EQ(a.build_s, b.build_s);
  for (const auto& [x, y] :
       {std::pair(a.lattice, b.lattice), std::pair(a.influence.corners, b.influence.corners)}) {
    expectSameBits(x.first, y.first);
    expectSameBits(x.spacing, y.spacing);
    EXPECT_EQ(x.count, y.count);
  }
  EXPECT_EQ(a.probe_of_point, b.probe_of_point);
  EXPECT_EQ(a.influence.voxel_begin, b.influence.voxel_begin);
  EXPECT_EQ(a.influence.nearest, b.influence.nearest);
  EXPECT_EQ(a.influence.pieces.plane_of_voxel, b.influence.pieces.plane_of_voxel);
  EXPECT_EQ(a.influence.pieces.planes, b.influence.pieces.planes);
  ASSERT_EQ(a.influence.entries.size(), b.influence.entries.size());
  for (std::size_t i = 0; i < a.influence.entries.size(); ++i) {
    EXPECT_EQ(a.influence.entries[i].probe, b.influence.entries[i].probe);
    EXPECT_EQ(a.influence.entries[i].weights, b.influence.entries[i].weights);
  }
}

TEST_F(LayoutFile, EveryBitComesBack) {
  const Scene scene = room();
  // The case needs positions that world coordinates alone do not give back.
  const Vec3f lost(0.1f, 1e-7f, 2);
  ASSERT_NE(toLocal(scene, toWorld(scene, lost)), lost);
  expectSame(roundTrip(scattered(scene), scene), scattered(scene));
  expectSame(roundTrip(lattice(scene), scene), lattice(scene));
}

TEST_F(LayoutFile, WritingWhatWasReadGivesTheSameBytes) {
  const Scene scene = room();
  writeLayout(path_, scattered(scene), scene);
  const std::string once = readTextFile(path_);
  writeLayout(path_, readLayout(path_, scene), scene);
  EXPECT_EQ(readTextFile(path_), once);
}

TEST_F(LayoutFile, PlacesAreWorldCoordinates) {
  Scene scene = room();
  scene.origin = Vec3d(100, 0, -8);
  ProbeLayout layout = scattered(scene);
  layout.positions[0] = Vec3f(1, 2, 0.5f);
  writeLayout(path_, layout, scene);
  EXPECT_NE(readTextFile(path_).find("{\"position\":[101.0,2.0,-7.5],"), std::string::npos);
}

TEST_F(LayoutFile, LightsMayChangeGeometryAndVolumeMayNot) {
  const Scene scene = room();
  writeLayout(path_, scattered(scene), scene);
  Scene other = scene;
  other.content_hash = "4567";
  other.state = "evening";
  other.lights.push_back({.name = "lamp"});
  EXPECT_NO_THROW(readLayout(path_, other));
  Scene larger = scene;
  larger.bounds.max.x += 0.5f;
  EXPECT_THROW(readLayout(path_, larger), InputError);
  for (const int change : {0, 1}) {
    auto geometry = std::make_shared<Geometry>(*scene.geometry);
    if (change == 0) geometry->positions[5].y += 0.001f;
    if (change == 1) std::swap(geometry->triangles[0].vertex[0], geometry->triangles[0].vertex[1]);
    other.geometry = geometry;
    EXPECT_NE(geometryHash(other), geometryHash(scene));
    EXPECT_THROW(readLayout(path_, other), InputError);
  }
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST_F(LayoutFile, WhatDoesNotFitIsRefusedByName) {
  Scene scene = room();
  scene.origin = Vec3d(0);
  ProbeLayout layout = scattered(scene);
  layout.positions[0] = Vec3f(1, 2, 0.5f);
  layout.lengths[0].bias = 0.25f;
  writeLayout(path_, layout, scene);
  const std::string good = readTextFile(path_);
  EXPECT_EQ(refusal(good, scene), "");
  struct Damage {
    const char *from, *to, *message;
  };
  const Damage damages[] = {
      {"probelab layout 2", "probelab layout 1", "'format'"},
      {"\"asked\": 32", "\"asked\": -1", "'asked'"},
      {"\"asked\": 32", "\"asked\": 1", "'asked' is 1, but there are"},
      {"\"asked\": 32", "\"asked\": 32.5", "'asked'"},
      {"\"asked\": 32", "\"asked\": \"32\"", "'asked'"},
      {"\"asked\": 32", "\"asked\": 99999999999", "'asked'"},
      {"\"asked\": 32", "\"asked\": 32, \"asked\": 32", "'asked' stands twice"},
      {"\"asked\"", "\"aksed\"", "did you mean 'asked'"},
      {"\"evaluations\": 12345,", "", "'evaluations' is missing"},
      {"\"seed\": 18364758544493064720", "\"seed\": -3", "'seed'"},
      {"\"build_s\": 0.3", "\"build_s\": 1e999, \"seed\": 0.3", "not a JSON object"},
      {"\"build_s\": 0.3", "\"build_s\": -0.3", "'build_s'"},
      {"\"fitted\"", "\"fited\"", "'fitted'"},
      {"\"fitted\"", "\"lattice\"", "'influence' does not go with"},
      {"\"lights\":\"6\"", "\"lights\":6", "'lights'"},
      {"[1.0,2.0,0.5]", "[1.0,2.0]", "probes[0]: 'position'"},
      {"[1.0,2.0,0.5]", "[1.0,2.0,0.5,0.0]", "probes[0]: 'position'"},
      {"[1.0,2.0,0.5]", "[1.0,2.0,null]", "probes[0]: 'position'"},
      {"[1.0,2.0,0.5]", "[1.0,2.0,1e39]", "probes[0]: 'position'"},
      {"[1.0,2.0,0.5]", "[1.0,2.0,0.5,1.0,2.0,0.6]", "probes[0]: 'position'"},
      {"\"bias_m\":0.25", "\"bias_m\":0.0", "probes[0]: 'bias_m'"},
      {"\"bias_m\":0.25", "\"bias\":0.25", "probes[0]: unknown key 'bias'"},
      {"\"bias_m\":0.25", "\"support_m\":0.25", "'support_m' stands twice"},
      {"\"pinned\":true", "\"pinned\":1", "probes[7]: 'pinned'"},
      {"\"count\":[5,4,4]", "\"count\":[5,4,5]", "voxels"},
      {"\"count\":[5,4,4]", "\"count\":[1,4,4]", "corners"},
      {"\"count\":[5,4,4]", "\"count\":[5,4]", "'count'"},
      {"\"count\":[5,4,4]", "\"count\":[100000,100000,100000]", "'count'"},
      {"\"voxel_begin\":[0,", "\"voxel_begin\":[1,", "first entries"},
      {"\"nearest\":[", "\"nearest\":[30,", "voxels"},
      {"\"entry_weights\":\"", "\"entry_weights\":\"0", "'entry_weights'"},
      {"\"entry_weights\":\"", "\"entry_weights\":7, \"x\":\"", "unknown key 'x'"},
      {"\"support_radius_m\": ", "\"support_radius_m\": -", "'support_radius_m'"},
      {"\"volume\": {\"min\":[", "\"volume\": {\"min\":[0.5,", "'volume'"},
  };
  for (const Damage& damage : damages) {
    const std::string message = refusal(replaced(good, damage.from, damage.to), scene);
    EXPECT_NE(message.find(damage.message), std::string::npos)
        << damage.to << " gives: " << message;
    if (!message.empty()) EXPECT_NE(message.find(path_.string()), std::string::npos) << message;
  }
  EXPECT_NE(refusal("[]", scene), "");
  EXPECT_NE(refusal("", scene), "");
  for (std::size_t cut = 0; cut + 4 < good.size(); cut += good.size() / 50)
    EXPECT_NE(refusal(good.substr(0, cut), scene), "");
  EXPECT_THROW(readLayout(path_.string() + ".none", scene), InputError);
}

TEST_F(LayoutFile, BrokenLatticesAreRefused) {
  const Scene scene = room();
  writeLayout(path_, lattice(scene), scene);
  const std::string good = readTextFile(path_);
  const auto refuses = [&](const char* from, const char* to, const char* message) {
    const std::string text = refusal(replaced(good, from, to), scene);
    EXPECT_NE(text.find(message), std::string::npos) << to << " gives: " << text;
  };
  refuses("\"probe_of_point\":[0,", "\"probe_of_point\":[10,", "probe 10 of 10");
  refuses("\"probe_of_point\":[0,", "\"probe_of_point\":[-2,", "'probe_of_point'[0]");
  refuses("\"probe_of_point\":[0,", "\"probe_of_point\":[", "lattice points");
  refuses("\"probe_of_point\":[0,", "\"probe_of_point\":[1,", "another point's already");
  refuses("\"probe_of_point\":[0,", "\"probe_of_point\":[-1,", "probe 0 is at no lattice point");
  refuses("\"count\":[4,1,3]", "\"count\":[4,2,3]", "lattice points");
  refuses("{\"position\":", "{\"bias_m\":1.0,\"position\":", "probes[0]: unknown key 'bias_m'");
}

}  // namespace
}  // namespace probelab
