// SPDX-License-Identifier: GPL-3.0-or-later
// Voxels that walls divide: nothing behind a wall counts, and weights jump within walls alone.
#include "placement/wall_pieces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <string>
#include <tuple>

#include "ddgi/influence.h"
#include "base/error.h"
#include "placement/scattered.h"
#include "places.h"
#include "scattered_helpers.h"

namespace probelab::test {
namespace {

// Two rooms 3 m deep and high beside each other, `wall_m` of wall about x = `middle` between them (0:
// one sheet seen from both sides), in it a door of 1 x 2 m if asked for. A camera in each.
Scene dividedRooms(float wall_m, float middle, bool door) {
  SceneBuilder b;
  const uint32_t grey = b.material(Vec3f(0.6f)), both = b.material(Vec3f(0.6f), Vec3f(), true);
  b.box({-3, 0, 0}, {3, 3, 3}, grey, true);
  b.box({-3.2f, -0.2f, -0.2f}, {3.2f, 3.2f, 3.2f}, grey, false);
  const float h = 0.5f * wall_m;
  const auto slab = [&](float y0, float y1, float z0, float z1) {
    if (wall_m > 0)
      b.box({middle - h, y0, z0}, {middle + h, y1, z1}, grey, false);
    else
      b.quad({middle, y0, z0}, {middle, y0, z1}, {middle, y1, z1}, {middle, y1, z0}, both);
  };
  if (door)
    slab(0, 3, 0, 1), slab(0, 3, 2, 3), slab(2, 3, 1, 2);
  else
    slab(0, 3, 0, 3);
  b.pointLight({-1.5f, 2, 1.5f}, Vec3f(10));
  b.camera({-1, 1, 1}, {-2, 1, 2});
  b.camera({1, 1, 1}, {2, 1, 2});
  return b.finish();
}

std::vector<Vec3f> somePlaces(const FreeSpace& space, int count) {
  std::vector<Vec3f> places;
  Rng rng(5, RngStream::test);
  while (static_cast<int>(places.size()) < count) places.push_back(space.sample(rng));
  return places;
}

ProbeLayout layoutOf(Place& place, const std::vector<Vec3f>& positions, const std::string& walls,
                     const std::string& cells = "3") {
  const PlacementInput input = place.input(
      static_cast<int>(positions.size()), 1,
      resolveOptions(findStrategy("poisson"), {"walls=" + walls, "cells=" + cells}));
  return scatterProbes(FreeSpace(input), positions);
}

// Share of each probe at a place, sum 1.
std::map<uint32_t, double> sharesAt(const InfluenceGrid& grid, const Vec3f& p) {
  const VoxelPlace at = voxelAt(grid.corners, grid.pieces, p);
  std::map<uint32_t, double> shares;
  double sum = 0;
  for (uint32_t e = grid.voxel_begin[at.piece]; e < grid.voxel_begin[at.piece + 1]; ++e) {
    double share = 0;
    for (std::size_t k = 0; k < 8; ++k)
      share += static_cast<double>(at.share[k]) *
               static_cast<double>(byteWeight(grid.entries[e].weights[k]));
    if (share > 0) sum += shares[grid.entries[e].probe] = share;
  }
  for (auto& [probe, share] : shares) share /= sum;
  return shares;
}

// Thickness of the wall and where its middle lies in a voxel, as a share of it: 0 between two.
class DividedVoxels : public ::testing::TestWithParam<std::tuple<float, float>> {};

// Places up to a millimetre from the wall, whatever its thickness; without pieces the other room's
// probes have half of the weight there.
TEST_P(DividedVoxels, ProbesBehindAWallHaveNoWeight) {
  const auto [wall_m, share_of_voxel] = GetParam();
  const std::string cells = wall_m > 0.1f ? "2" : "3";  // so that a voxel holds the whole wall
  const float middle = [&](float share) {
    Place anywhere(dividedRooms(wall_m, 0, false));
    const Lattice corners =
        layoutOf(anywhere, somePlaces(FreeSpace(anywhere.input(40)), 40), "off", cells)
            .influence.corners;
    const float in_the_middle = std::floor(0.5f * static_cast<float>(corners.count.x));
    return corners.first.x + (in_the_middle + share) * corners.spacing.x;
  }(share_of_voxel);
  Place place(dividedRooms(wall_m, middle, false));
  const PlacementInput input = place.input(40);
  const std::vector<Vec3f> positions = somePlaces(FreeSpace(input), 40);
  double behind[2] = {};  // largest share of the other room's probes
  for (const bool walls : {false, true}) {
    const ProbeLayout layout = layoutOf(place, positions, walls ? "on" : "off", cells);
    EXPECT_EQ(layout.influence.pieces.any(), walls);
    EXPECT_EQ(!layout.influence.pieces.planes.empty(), walls && share_of_voxel != 0);
    Rng rng(6, RngStream::test);
    for (int i = 0; i < 3000; ++i) {
      const float side = i % 2 == 0 ? -1.0f : 1.0f;
      const float off = 0.5f * wall_m + 0.001f + 0.8f * rng.nextFloat() * rng.nextFloat();
      const float y = 0.02f + 2.96f * rng.nextFloat(), z = 0.02f + 2.96f * rng.nextFloat();
      const Vec3f p(middle + side * off, y, z);
      double other = 0;
      for (const auto& [probe, share] : sharesAt(layout.influence, p))
        if ((layout.positions[probe].x - middle) * side < 0) other += share;
      behind[walls] = std::max(behind[walls], other);
    }
  }
  EXPECT_GT(behind[0], 0.3);
  EXPECT_EQ(behind[1], 0);
}

// A wall anywhere in a voxel, also a few thousandths of it from a face, where the free space of a
// voxel on one side is a sliver.
TEST(WallPieces, SliversBesideAWallBelongToTheirOwnSide) {
  const float wall_m = 0.5f;
  const auto layoutWith = [&](float middle) {
    Place place(dividedRooms(wall_m, middle, false));
    const PlacementInput input = place.input(40);
    return layoutOf(place, somePlaces(FreeSpace(input), 40), "on");
  };
  const Lattice corners = layoutWith(0.17f).influence.corners;
  const float voxel = corners.spacing.x;
  const int near = static_cast<int>((0.4f - corners.first.x) / voxel);
  for (const float share : {0.002f, 0.005f, 0.02f, 0.05f, 0.5f, 0.95f, 0.98f, 0.995f, 0.998f}) {
    // The wall's right face lies that share of a voxel beyond a face of the voxels.
    const float right = corners.first.x + (static_cast<float>(near) + share) * voxel;
    const float middle = right - 0.5f * wall_m;
    const ProbeLayout layout = layoutWith(middle);
    ASSERT_NEAR(layout.influence.corners.spacing.x, voxel, 0.01f * voxel);
    Rng rng(6, RngStream::test);
    for (int i = 0; i < 2000; ++i) {
      const float side = i % 2 == 0 ? -1.0f : 1.0f;
      const float off = 0.5f * wall_m + 1e-4f + 0.05f * rng.nextFloat() * rng.nextFloat();
      const float y = 0.02f + 2.96f * rng.nextFloat(), z = 0.02f + 2.96f * rng.nextFloat();
      const Vec3f p(middle + side * off, y, z);
      for (const auto& [probe, weight] : sharesAt(layout.influence, p))
        ASSERT_TRUE((layout.positions[probe].x - middle) * side > 0 || weight == 0)
            << "share " << share << ", " << off << " m from the middle, side " << side;
    }
  }
}

TEST(WallPieces, DamagedPlanesAreRefused) {
  Place place(dividedRooms(0.05f, 0.17f, false));
  const PlacementInput input = place.input(40);
  const InfluenceGrid good =
      layoutOf(place, somePlaces(FreeSpace(input), 40), "on").influence;
  ASSERT_GT(good.pieces.planes.size(), 1u);
  EXPECT_NO_THROW(validateInfluence(good, 40, "grid"));
  const auto message = [&](const auto& damage) -> std::string {
    InfluenceGrid grid = good;
    damage(grid.pieces);
    try {
      validateInfluence(grid, 40, "grid");
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  const auto has = [](const std::string& text, const char* part) {
    return text.find(part) != std::string::npos ? ::testing::AssertionSuccess()
                                                : ::testing::AssertionFailure() << text;
  };
  for (const float offset : {1e6f, -1e6f, 3e38f})
    EXPECT_TRUE(has(message([&](VoxelPieces& p) { p.planes[1].w = offset; }), "does not pass"));
  for (const float offset : {std::numeric_limits<float>::infinity(),
                             std::numeric_limits<float>::quiet_NaN()})
    EXPECT_TRUE(has(message([&](VoxelPieces& p) { p.planes[1].w = offset; }), "plane 1 must"));
  EXPECT_TRUE(has(message([](VoxelPieces& p) { p.planes[0] = Vec4f(2, 0, 0, 0); }), "a unit"));
  const auto divided = static_cast<std::size_t>(
      std::ranges::find(good.pieces.plane_of_voxel, 1) - good.pieces.plane_of_voxel.begin());
  EXPECT_TRUE(has(message([&](VoxelPieces& p) { p.plane_of_voxel[divided] = 0; }),
                  "already"));
  EXPECT_TRUE(has(message([&](VoxelPieces& p) { p.plane_of_voxel[divided] = 100000; }),
                  "plane 100000 of"));
  EXPECT_TRUE(has(message([&](VoxelPieces& p) { p.plane_of_voxel[divided] = -1; }),
                  "plane 1 must divide"));
  EXPECT_TRUE(has(message([](VoxelPieces& p) { p.plane_of_voxel.pop_back(); }), "planes of voxels"));
}

INSTANTIATE_TEST_SUITE_P(Walls, DividedVoxels,
                         ::testing::Combine(::testing::Values(0.0f, 0.001f, 0.05f, 0.2f),
                                            ::testing::Values(0.0f, 0.2f, 0.5f, 0.81f)),
                         [](const auto& info) {
                           const auto whole = [](float x) { return std::to_string(std::lround(x)); };
                           return whole(1000 * std::get<0>(info.param)) + "mm_at_" +
                                  whole(100 * std::get<1>(info.param));
                         });

// Along lines within the free space, through the door as well: a share changes in a step by no more
// than the step's part of a voxel times the eight corners, so no voxel's face and no edge of the
// wall shows.
TEST(WallPieces, WeightsAreContinuousInTheFreeSpace) {
  Place place(dividedRooms(0.1f, 0.17f, true));
  const PlacementInput input = place.input(60);
  const FreeSpace space(input);
  const std::vector<Vec3f> positions = somePlaces(space, 60);
  const ProbeLayout layout = layoutOf(place, positions, "on");
  EXPECT_GT(layout.influence.pieces.planes.size(), 10u);
  const float voxel = minComponent(layout.influence.corners.spacing);
  Rng rng(7, RngStream::test);
  int lines = 0, through_door = 0;
  for (int tries = 0; tries < 4000 && lines < 300; ++tries) {
    const Vec3f a = space.sample(rng), b = space.sample(rng);
    if (!space.lineFree(a, b)) continue;
    ++lines;
    through_door += (a.x - 0.17f) * (b.x - 0.17f) < 0 ? 1 : 0;
    const int steps = static_cast<int>(length(b - a) / (1e-3f * voxel));
    std::map<uint32_t, double> before;
    for (int i = 0; i <= steps; ++i) {
      const float t = static_cast<float>(i) / static_cast<float>(steps);
      std::map<uint32_t, double> now = sharesAt(layout.influence, a + (b - a) * t);
      double change = 0;
      for (const auto& [probe, share] : now) change += std::abs(share - (i ? before[probe] : share));
      ASSERT_LT(change, 0.02) << "line " << lines << " at " << t;
      before = std::move(now);
    }
  }
  EXPECT_EQ(lines, 300);
  EXPECT_GT(through_door, 10);
}

// Probes of the left room are white, those of the right black. A place that faces the wall between
// them, nearer than its biases are long, answers as its own room does.
TEST(WallPieces, BiasesLeadThroughNoWall) {
  for (const float wall_m : {0.0f, 0.05f}) {
    const float middle = 0.17f;
    Place place(dividedRooms(wall_m, middle, false));
    const ProbeLayout layout = layoutOf(place, somePlaces(FreeSpace(place.input(40)), 40), "on");
    Params params = loadParams("probelab");
    params.normal_bias = 0.3, params.view_bias = 0.2;
    FieldSnapshot snapshot = layoutSnapshot(layout, initialStates(layout), params);
    fillTexels(snapshot, 8);
    const std::size_t per_probe = snapshot.irradiance.size() / layout.positions.size();
    for (std::size_t i = 0; i < snapshot.irradiance.size(); ++i)
      snapshot.irradiance[i] = Vec3f(layout.positions[i / per_probe].x < middle ? 1.0f : 0.0f);
    Rng rng(9, RngStream::test);
    for (int i = 0; i < 2000; ++i) {
      const float side = i % 2 == 0 ? -1.0f : 1.0f;
      const float off = 0.5f * wall_m + 0.002f + layout.bias_length_m * rng.nextFloat();
      const float y = 0.02f + 2.96f * rng.nextFloat(), z = 0.02f + 2.96f * rng.nextFloat();
      const Vec3f to_wall(-side, 0, 0);
      const QueryPoint point{Vec3f(middle + side * off, y, z), to_wall, -to_wall};
      const double answer = querySnapshot<double>(snapshot, snapshot.params, point).irradiance.x;
      ASSERT_NEAR(answer / std::numbers::pi, side < 0 ? 1 : 0, 1e-6) << off << " from the wall";
    }
  }
}

// Every corner of a piece has weights; planes divide one voxel each; the same again is the same.
TEST(WallPieces, CoverEveryVoxelOfOpenAndClosedScenes) {
  for (const Scene& scene : {pillarRoom(), openYard(), emptySpace(), corridor()}) {
    Place place(scene);
    const PlacementInput input = place.input(30);
    const std::vector<Vec3f> positions = somePlaces(FreeSpace(input), 30);
    const ProbeLayout layout = layoutOf(place, positions, "on"), again = layoutOf(place, positions, "on");
    validateInfluence(layout.influence, positions.size(), "pieces");  // throws
    EXPECT_EQ(layout.influence.pieces.plane_of_voxel, again.influence.pieces.plane_of_voxel);
    EXPECT_EQ(layout.influence.voxel_begin, again.influence.voxel_begin);
  }
}

TEST(WallPieces, AVoxelsSidesReadTheirOwnProbe) {
  const Lattice corners = makeLattice({{0, 0, 0}, {1, 1, 1}}, {2, 2, 2});
  // Corners 0 to 7 belong to the front and probe 0; list 8 is probe 1 alone.
  CornerWeights weights(8, {{0, 1.0f}});
  weights.push_back({{1, 1.0f}});
  VoxelPieces pieces;
  pieces.plane_of_voxel = {0};
  pieces.planes = {Vec4f(1, 0, 0, -0.25f)};  // x = 0.25
  pieces.lists = {{0, 1, 2, 3, 4, 5, 6, 7}, {8, 8, 8, 8, 8, 8, 8, 8}};
  const InfluenceGrid grid =
      makeInfluence(corners, weights, {Vec3f(0.9f), Vec3f(0.1f)}, pieces);
  validateInfluence(grid, 2, "hand");
  EXPECT_EQ(sharesAt(grid, {0.26f, 0.5f, 0.5f}).begin()->first, 0u);
  EXPECT_EQ(sharesAt(grid, {0.24f, 0.5f, 0.5f}).begin()->first, 1u);
  EXPECT_EQ(grid.nearest, (std::vector<int32_t>{0, 1}));
  for (const auto& damage : std::vector<void (*)(InfluenceGrid&)>{
           [](InfluenceGrid& g) { g.pieces.planes[0].x = 2; },
           [](InfluenceGrid& g) { g.pieces.planes[0].w = NAN; },
           [](InfluenceGrid& g) { g.pieces.plane_of_voxel[0] = 1; },
           [](InfluenceGrid& g) { g.pieces.plane_of_voxel[0] = -1; },
           [](InfluenceGrid& g) { g.pieces.plane_of_voxel.push_back(0); }}) {
    InfluenceGrid damaged = grid;
    damage(damaged);
    EXPECT_THROW(validateInfluence(damaged, 2, "hand"), InputError);
  }
}

}  // namespace
}  // namespace probelab::test
