// SPDX-License-Identifier: GPL-3.0-or-later
// Voxels' entries from corner weights, and the lengths of scattered probes.
#include <gtest/gtest.h>

#include "base/error.h"
#include "scattered_helpers.h"

namespace probelab {
namespace {

const Box3f kBox{Vec3f(0), Vec3f(4, 3, 2)};

// A probe's byte at a corner, as each voxel around it says.
std::vector<int> bytesAt(const InfluenceGrid& grid, const Vec3i& corner, uint32_t probe) {
  std::vector<int> bytes;
  const Vec3i n = grid.voxels();
  for (int k = 0; k < 8; ++k) {
    const Vec3i v(corner.x - (k & 1), corner.y - (k >> 1 & 1), corner.z - (k >> 2));
    if (v.x < 0 || v.y < 0 || v.z < 0 || v.x >= n.x || v.y >= n.y || v.z >= n.z) continue;
    const auto voxel = static_cast<std::size_t>((v.z * n.y + v.y) * n.x + v.x);
    bytes.push_back(0);
    for (uint32_t e = grid.voxel_begin[voxel]; e < grid.voxel_begin[voxel + 1]; ++e)
      if (grid.entries[e].probe == probe)
        bytes.back() = grid.entries[e].weights[static_cast<std::size_t>(k)];
  }
  return bytes;
}

TEST(Influence, CornersAreScaledToOneAndRoundedAlikeInAllTheirVoxels) {
  const Lattice corners = makeLattice(kBox, Vec3i(3, 3, 3));
  CornerWeights weights(27, {{1, 2.0f}});
  // The middle one: 0.4 and 0.6, whose roots are 80.95 and 99.15 in units of 1 / 128.
  weights[13] = {{2, 0.6f}, {0, 1.2f}, {2, 0.2f}, {3, 0.0f}};
  const std::vector<Vec3f> positions(4, Vec3f(1));
  const InfluenceGrid grid = makeInfluence(corners, weights, positions);
  EXPECT_EQ(grid.voxel_begin.size(), 9u);
  EXPECT_EQ(bytesAt(grid, Vec3i(1, 1, 1), 2), std::vector<int>(8, 81));
  EXPECT_EQ(bytesAt(grid, Vec3i(1, 1, 1), 0), std::vector<int>(8, 99));
  EXPECT_EQ(bytesAt(grid, Vec3i(1, 1, 1), 1), std::vector<int>(8, 0));
  EXPECT_EQ(bytesAt(grid, Vec3i(0, 2, 1), 1), std::vector<int>(2, 128));
  for (const InfluenceEntry& entry : grid.entries) EXPECT_NE(entry.probe, 3u);
  EXPECT_NO_THROW(validateInfluence(grid, 4, "test"));
  EXPECT_EQ(influenceBytes(grid), 9u * 4 + grid.entries.size() * 12);
}

TEST(Influence, AFitsCornersKeepWhatTheyWeighAgainstEachOther) {
  const Lattice corners = makeLattice(kBox, Vec3i(2, 2, 2));
  CornerWeights weights(8);
  for (std::size_t k = 0; k < 8; ++k)  // 2 at x = 0, half a unit at x = 4
    weights[k] = k % 2 == 0 ? std::vector<CornerWeight>{{0, 1.5f}, {1, 0.5f}}
                            : std::vector<CornerWeight>{{1, 0.5f}};
  const std::vector<Vec3f> positions(2, Vec3f(1));
  const InfluenceGrid kept = makeInfluence(corners, weights, positions, {}, CornerScale::kept);
  ASSERT_EQ(kept.entries.size(), 2u);
  EXPECT_NEAR(byteWeight(kept.entries[0].weights[0]), 1.5, 0.01);
  EXPECT_NEAR(byteWeight(kept.entries[1].weights[0]), 0.5, 0.006);
  EXPECT_NEAR(byteWeight(kept.entries[1].weights[1]), 0.5, 0.006);
  const InfluenceGrid one = makeInfluence(corners, weights, positions);
  EXPECT_NEAR(byteWeight(one.entries[0].weights[0]), 0.75, 0.007);
  EXPECT_EQ(one.entries[1].weights[1], 128);
  // What no byte can hold takes its corner down.
  weights[0] = {{0, 39.0f}, {1, 10.0f}};
  const InfluenceGrid held = makeInfluence(corners, weights, positions, {}, CornerScale::kept);
  EXPECT_NEAR(byteWeight(held.entries[0].weights[0]), 3.9, 0.02);
  EXPECT_NEAR(byteWeight(held.entries[1].weights[0]), 1.0, 0.01);
}

TEST(Influence, TheLargestWeightStaysWhereAllRoundToNothing) {
  const Lattice corners = makeLattice(kBox, Vec3i(2, 2, 2));
  std::vector<CornerWeight> many;
  for (uint32_t p = 0; p < 5000; ++p) many.push_back({p, p == 700 ? 1.1f : 1.0f});
  const InfluenceGrid grid =
      makeInfluence(corners, CornerWeights(8, many), std::vector<Vec3f>(5000, Vec3f(1)));
  ASSERT_EQ(grid.entries.size(), 1u);
  EXPECT_EQ(grid.entries[0].probe, 700u);
  EXPECT_EQ(grid.entries[0].weights, (std::array<uint8_t, 8>{2, 2, 2, 2, 2, 2, 2, 2}));
}

// Along a row of corners with probes at its ends: rings meet in the middle.
TEST(Influence, EmptyCornersTakeTheMeanOfTheirNeighbours) {
  const Lattice corners = makeLattice(kBox, Vec3i(6, 2, 2));
  CornerWeights weights(24);
  for (const int at : {0, 6, 12, 18}) weights[static_cast<std::size_t>(at)] = {{0, 1.0f}};
  for (const int at : {4, 10, 16, 22}) weights[static_cast<std::size_t>(at)] = {{1, 1.0f}};
  const InfluenceGrid grid = makeInfluence(corners, weights, {Vec3f(0), Vec3f(3, 0, 0)});
  for (const int y : {0, 1}) {
    EXPECT_EQ(bytesAt(grid, Vec3i(1, y, 0), 0).front(), 128);
    EXPECT_EQ(bytesAt(grid, Vec3i(3, y, 0), 1).front(), 128);
    EXPECT_EQ(bytesAt(grid, Vec3i(5, y, 1), 1).front(), 128);
    for (const uint32_t probe : {0u, 1u})
      EXPECT_EQ(bytesAt(grid, Vec3i(2, y, 1), probe).front(), 91);  // 128 sqrt(1 / 2)
  }
  EXPECT_EQ(grid.nearest, (std::vector<int32_t>{0, 0, 1, 1, 1}));
}

TEST(Influence, WithoutAnyProbeThereIsNoGrid) {
  const Lattice corners = makeLattice(kBox, Vec3i(2, 2, 2));
  EXPECT_THROW(makeInfluence(corners, CornerWeights(8), {Vec3f(0)}), InputError);
  EXPECT_THROW(makeInfluence(corners, CornerWeights(8, {{0, 0.0f}}), {Vec3f(0)}), InputError);
}

TEST(Influence, InactiveProbesLeaveAndTheNearestActiveOneAnswers) {
  const ProbeLayout layout = test::randomScattered(kBox, 40, Vec3i(5, 5, 4), kBox, 1);
  std::vector<uint8_t> active(40, 0);
  active[3] = active[17] = 1;
  const InfluenceGrid grid = activeInfluence(layout.influence, layout.positions, active);
  std::size_t kept = 0;
  for (const InfluenceEntry& entry : layout.influence.entries) kept += active[entry.probe];
  ASSERT_GT(kept, 0u);
  EXPECT_EQ(grid.entries.size(), kept);
  for (const InfluenceEntry& entry : grid.entries) EXPECT_NE(active[entry.probe], 0);
  for (std::size_t v = 0; v < grid.nearest.size(); ++v) {
    const uint32_t begin = grid.voxel_begin[v], end = grid.voxel_begin[v + 1];
    EXPECT_TRUE(grid.nearest[v] == 3 || grid.nearest[v] == 17);
    if (end - begin == 1)
      EXPECT_EQ(grid.nearest[v], static_cast<int32_t>(grid.entries[begin].probe));
  }
  const InfluenceGrid none =
      activeInfluence(layout.influence, layout.positions, std::vector<uint8_t>(40, 0));
  EXPECT_EQ(none.nearest, std::vector<int32_t>(none.nearest.size(), -1));
}

TEST(Influence, BrokenGridsAreRefused) {
  const ProbeLayout layout = test::randomScattered(kBox, 20, Vec3i(4, 4, 3), kBox, 2);
  const auto refuses = [&](const auto& damage) {
    InfluenceGrid grid = layout.influence;
    damage(grid);
    try {
      validateInfluence(grid, 20, "grid");
    } catch (const InputError& error) {
      return std::string(error.what()).starts_with("grid: ");
    }
    return false;
  };
  EXPECT_FALSE(refuses([](InfluenceGrid&) {}));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { g.corners.count.x = 1; }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { g.corners.count = Vec3i(1 << 20); }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { g.corners.spacing.y = 0; }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { g.corners.first.y = NAN; }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { g.voxel_begin.pop_back(); }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { g.voxel_begin[3] = 1 << 30; }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { ++g.voxel_begin.back(); }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { g.entries[5].probe = 20; }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { std::swap(g.entries[0], g.entries[1]); }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { g.nearest[0] = 20; }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { g.nearest[0] = -1; }));
  // A corner that its voxels disagree about would be a jump; one without weights a hole.
  EXPECT_TRUE(refuses([](InfluenceGrid& g) { g.entries[2].weights[7] ^= 1; }));
  EXPECT_TRUE(refuses([](InfluenceGrid& g) {
    for (InfluenceEntry& entry : g.entries) entry.weights = {};
  }));
}

TEST(ScatteredLayout, BiasLengthIsTheMeanDistanceToSixNeighbours) {
  Rng rng(3, RngStream::test);
  for (const int probes : {1, 2, 5, 7, 300}) {
    const ProbeLayout layout = test::randomScattered(kBox, probes, Vec3i(3, 3, 3), kBox, 4, 3);
    double mean = 0;
    for (std::size_t p = 0; p < layout.positions.size(); ++p) {
      std::vector<float> distances;
      for (std::size_t q = 0; q < layout.positions.size(); ++q)
        if (q != p) distances.push_back(length(layout.positions[q] - layout.positions[p]));
      std::sort(distances.begin(), distances.end());
      distances.resize(std::min<std::size_t>(distances.size(), 6));
      double expected = 0;
      for (const float d : distances) expected += static_cast<double>(d);
      expected = distances.empty() ? 4 : expected / static_cast<double>(distances.size());
      EXPECT_NEAR(layout.lengths[p].bias, expected, 1e-6);
      mean += expected / probes;
    }
    EXPECT_NEAR(layout.bias_length_m, mean, 1e-5);
    EXPECT_NO_THROW(validateLayout(layout, loadParams("rtxgi")));
  }
}

// A probe that is the only one at a lattice's point reaches to the point's neighbours.
TEST(ScatteredLayout, SupportEndsWhereTheWeightIsZero) {
  const Lattice lattice = makeLattice(kBox, Vec3i(5, 4, 3));  // cubes of 1 m
  const ProbeLayout grid = latticeLayout(lattice, kBox, std::vector<uint8_t>(60, 1));
  CornerWeights weights;
  for (uint32_t p = 0; p < 60; ++p) weights.push_back({{p, 1.0f}});
  weights[59].clear();  // a corner without probes gives its neighbours no longer reach
  const ProbeLayout layout =
      scatteredLayout(Interpolant::fitted, grid.positions, kBox, lattice, weights);
  for (std::size_t p = 0; p < 59; ++p)
    EXPECT_NEAR(layout.lengths[p].support, std::sqrt(3.0), 2e-6) << p;
  EXPECT_EQ(layout.lengths[59].support, layout.lengths[59].bias);  // it counts nowhere
  EXPECT_NEAR(layout.support_radius_m, std::sqrt(3.0), 1e-6);
}

TEST(ScatteredLayout, ProbesInOnePlaceAreRefused) {
  const Lattice corners = makeLattice(kBox, Vec3i(2, 2, 2));
  const ProbeLayout layout = scatteredLayout(Interpolant::knn, std::vector<Vec3f>(8, Vec3f(1)),
                                             kBox, corners, CornerWeights(8, {{0, 1.0f}}));
  EXPECT_THROW(validateLayout(layout, loadParams("rtxgi")), InputError);
}

// Where weights follow the probes, one on its neighbour's place would divide by nothing.
TEST(LatticeLayout, ProbesStayBetweenTheirNeighboursWhereWeightsFollowThem) {
  const Lattice lattice = makeLattice(kBox, Vec3i(5, 4, 3));
  ProbeLayout layout = latticeLayout(lattice, kBox, std::vector<uint8_t>(60, 1));
  Params params = loadParams("rtxgi");
  params.relocation = 0;
  layout.positions[7].y += 0.9f;
  for (const bool follow : {false, true}) {
    params.offset_weights = follow ? 1 : 0;
    EXPECT_NO_THROW(validateLayout(layout, params));
  }
  params.relocation = 1;
  EXPECT_THROW(validateLayout(layout, params), InputError);
  params.relocation = 0;
  layout.positions[7].y += 0.1f;
  EXPECT_THROW(validateLayout(layout, params), InputError);
  layout.positions[7].y = NAN;
  EXPECT_THROW(validateLayout(layout, params), InputError);
}

TEST(ScatteredLayout, InterpolantsHaveNames) {
  for (const char* name : {"lattice", "knn", "tetrahedra", "natural", "maxent", "fitted"})
    EXPECT_STREQ(interpolantName(parseInterpolant(name)), name);
  EXPECT_THROW(parseInterpolant("knm"), InputError);
}

}  // namespace
}  // namespace probelab
