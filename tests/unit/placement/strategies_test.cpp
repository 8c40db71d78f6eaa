// SPDX-License-Identifier: GPL-3.0-or-later
// What every strategy owes: the budget, free places, the same layout for the same seed.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "base/error.h"
#ifdef PROBELAB_WITH_CGAL
#include "placement/distance.h"
#endif
#include "placement/grid.h"
#include "places.h"

namespace probelab::test {
namespace {

const std::vector<std::string> kRandom = {"jittered", "poisson"};

// Quick options; `file` is tested on its own.
OptionValues quickOptions(const std::string& name) {
  std::vector<std::string> pairs;
  if (name == "poisson_best") pairs = {"tries=3"};
  if (name == "optimized") pairs = {"start=sparse", "proposals=4", "pool=4", "pool_least=0", "fit=4",
                                       "generated=1", "check=off"};
  return resolveOptions(findStrategy(name), pairs);
}

std::vector<std::string> names() {
  std::vector<std::string> result;
  for (const Strategy& strategy : strategies())
    if (strategy.name != "file") result.push_back(strategy.name);
  return result;
}

void expectSound(Place& place, const std::string& name, int probes) {
  const ProbeLayout layout = placeProbes(name, place.input(probes, 1, quickOptions(name)));
  SCOPED_TRACE(name + " " + std::to_string(probes) + " in " + place.scene.name);
  EXPECT_GE(layout.positions.size(), 1u);
  EXPECT_LE(layout.positions.size(), static_cast<std::size_t>(probes));
  EXPECT_NO_THROW(validateLayout(layout, place.params));
  for (const Vec3f& p : layout.positions) {
    EXPECT_TRUE(isFinite(p));
    EXPECT_TRUE(isReachable(place.reachability, place.embree, p));
    EXPECT_FALSE(isInsideSolid(place.scene, place.embree, p));
  }
  EXPECT_EQ(layout.strategy, name);
  EXPECT_EQ(layout.asked, probes);
  EXPECT_EQ(layout.options.size(), findStrategy(name).options.size());
}

void expectAllSound(Scene scene, const std::string& scene_name) {
  scene.name = scene_name;
  Place place(std::move(scene));
  for (const std::string& name : names())
    for (const int probes : {1, 8, 64}) expectSound(place, name, probes);
}

TEST(Strategies, AreSoundInARoomWithAPillar) { expectAllSound(pillarRoom(), "pillar room"); }
TEST(Strategies, AreSoundInAMillimetreRoom) { expectAllSound(pillarRoom(1e-3f), "tiny room"); }
TEST(Strategies, AreSoundInAKilometreRoom) { expectAllSound(pillarRoom(1e3f), "huge room"); }
TEST(Strategies, AreSoundInTwoRooms) { expectAllSound(twoRooms(), "two rooms"); }
TEST(Strategies, AreSoundWhereTheMiddleIsWall) { expectAllSound(corridor(), "corridor"); }
TEST(Strategies, AreSoundOnOpenMeshes) { expectAllSound(openYard(), "yard"); }
TEST(Strategies, AreSoundWithoutGeometry) { expectAllSound(emptySpace(), "empty"); }

TEST(Strategies, GiveTheSameLayoutForTheSameSeed) {
  Place place(pillarRoom());
  for (const std::string& name : names()) {
    SCOPED_TRACE(name);
    const ProbeLayout a = placeProbes(name, place.input(40, 5, quickOptions(name)));
    const ProbeLayout b = placeProbes(name, place.input(40, 5, quickOptions(name)));
    EXPECT_EQ(a.positions, b.positions);
    ASSERT_EQ(a.influence.entries.size(), b.influence.entries.size());
    EXPECT_TRUE(std::ranges::equal(a.influence.entries, b.influence.entries,
                                   [](const InfluenceEntry& x, const InfluenceEntry& y) {
                                     return x.probe == y.probe && x.weights == y.weights;
                                   }));
  }
  for (const std::string& name : kRandom)
    EXPECT_NE(placeProbes(name, place.input(40, 5)).positions,
              placeProbes(name, place.input(40, 6)).positions);
}

TEST(Strategies, ScatteredOnesTakeEveryInterpolant) {
  Place place(twoRooms());
#ifdef PROBELAB_WITH_CGAL
  const std::vector<std::string> interpolants = {"maxent", "knn", "tetrahedra", "natural"};
#else
  const std::vector<std::string> interpolants = {"maxent", "knn", "natural"};
#endif
  for (const std::string& interpolant : interpolants)
    for (const int probes : {1, 2, 3, 30}) {
      const ProbeLayout layout =
          placeProbes("poisson", place.input(probes, 1, {{"interpolant", interpolant}}));
      EXPECT_NO_THROW(validateLayout(layout, place.params)) << interpolant << probes;
      EXPECT_EQ(layout.positions.size(), static_cast<std::size_t>(probes));
    }
}

TEST(Strategies, PoissonHitsTheBudgetAndKeepsProbesApart) {
  Place place(emptySpace());
  const ProbeLayout layout = placeProbes("poisson", place.input(200));
  ASSERT_EQ(layout.positions.size(), 200u);
  float least = 10;
  for (std::size_t i = 0; i < 200; ++i)
    for (std::size_t j = 0; j < i; ++j)
      least = std::min(least, length(layout.positions[i] - layout.positions[j]));
  // 8 m^3 for 200: 0.34 m each. Independent points would come within (2 / 200 / 199 * 8 * 3 / 4 pi)
  // ^ (1/3) = 0.05 m of each other.
  EXPECT_GT(least, 0.2f);
}

TEST(Strategies, SparseGridsComeNearTheBudget) {
  Place place(corridor());
  for (const int probes : {64, 500}) {
    const ProbeLayout sparse =
        placeProbes("grid_sparse", place.input(probes, 1, {{"sweep", "off"}}));
    EXPECT_GE(sparse.positions.size(), static_cast<std::size_t>(0.9 * probes));
    // The L fills 36 % of its box.
    EXPECT_LT(placeProbes("grid", place.input(probes)).positions.size(),
              static_cast<std::size_t>(0.6 * probes));
  }
}

// As many probes and no side of the room left bare, wherever the lattice lies.
TEST(Strategies, SparseGridsMove) {
  Place place(corridor());
  const auto at = [&](const char* offset) {
    return placeProbes("grid_sparse",
                       place.input(200, 1, {{"sweep", "off"}, {"offset", offset}}));
  };
  const ProbeLayout unmoved = at("0");
  const Box3f& room = place.reachability.reachable_box;
  for (const char* offset : {"-0.5", "-0.25", "0.25", "0.5"}) {
    const ProbeLayout moved = at(offset);
    EXPECT_LE(moved.positions.size(), 200u) << offset;
    EXPECT_GE(moved.positions.size(), 180u) << offset;
    EXPECT_NE(moved.positions, unmoved.positions) << offset;
    Box3f box;
    for (const Vec3f& p : moved.positions) box.extend(p);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_LT(box.min[axis] - room.min[axis], moved.lattice.spacing[axis]) << offset;
      EXPECT_LT(room.max[axis] - box.max[axis], moved.lattice.spacing[axis]) << offset;
    }
  }
  EXPECT_EQ(at("-0.5").positions, at("0.5").positions);
}

TEST(Strategies, GridBestScoresNoWorseThanGrid) {
  Place place(pillarRoom());
  const ProbeLayout grid = placeProbes("grid", place.input(60));
  const ProbeLayout best = placeProbes("grid_best", place.input(60));
  EXPECT_LE(place.training.score(best, place.params), place.training.score(grid, place.params));
  EXPECT_GE(best.evaluations, 24u);
  EXPECT_EQ(grid.evaluations, 0u);
}

#ifdef PROBELAB_WITH_CGAL

OptionValues findDefaults(const std::string& strategy) {
  return resolveOptions(findStrategy(strategy), {});
}

TEST(Relocated, MovesAtMostItsReachAndAlongFreeLines) {
  Place place(pillarRoom());
  const ProbeLayout layout =
      placeProbes("relocated", place.input(200, 1, {{"box", "bounds"}, {"clearance", "0.3"}}));
  const Lattice& lattice = layout.lattice;
  int moved = 0, rescued = 0;
  for (int i = 0; i < lattice.pointCount(); ++i) {
    const int probe = layout.probe_of_point[static_cast<std::size_t>(i)];
    if (probe < 0) continue;
    const Vec3f from = lattice.position(i);
    const Vec3f to = layout.positions[static_cast<std::size_t>(probe)];
    const float way = length(to - from);
    EXPECT_LE(way, 0.4501f * layout.bias_length_m);
    moved += way > 0 ? 1 : 0;
    if (isUsable(place.input(1), from)) {
      EXPECT_TRUE(isLineFree(place.embree, from, to));
    } else {
      ++rescued;
      EXPECT_GT(way, 0);
    }
  }
  EXPECT_GT(moved, 20);
  EXPECT_GT(rescued, 0);
}

TEST(Relocated, KeepsItsClearanceInARoom) {
  SceneBuilder b;
  b.box({0, 0, 0}, {3, 3, 3}, b.material(Vec3f(0.5f)), true);
  b.camera({1, 1, 1}, {2, 2, 2});
  Place place(b.finish());
  const ProbeLayout layout = placeProbes("relocated", place.input(64, 1, {{"clearance", "0.2"}}));
  EXPECT_EQ(layout.positions.size(), 64u);
  for (const Vec3f& p : layout.positions)
    EXPECT_GE(std::min(minComponent(p), 3 - maxComponent(p)), 0.99f * 0.2f * layout.bias_length_m);
}

// A lattice of which no point is free, and one whose points lie in a surface.
TEST(Relocated, MovesLatticesThatHaveNoFreePoint) {
  SceneBuilder b;
  const uint32_t grey = b.material(Vec3f(0.5f));
  b.box({0, 0, 0}, {4, 3, 4}, grey, true);
  b.box({1.9f, 0, 0}, {2.1f, 3, 3.5f}, grey, false);
  b.camera({1, 1, 1}, {1, 1, 2});
  Place place(b.finish());
  const Lattice lattice = gridLattice(place.input(1, 1, findDefaults("grid")));
  ASSERT_FALSE(isUsable(place.input(1), lattice.position(0)));
  const ProbeLayout layout = placeProbes("relocated", place.input(1));
  ASSERT_EQ(layout.positions.size(), 1u);
  EXPECT_GT(length(layout.positions[0] - lattice.position(0)), 0.1f);
  EXPECT_LT(length(layout.positions[0] - lattice.position(0)), 0.45f * layout.bias_length_m);
}

TEST(Relocated, LeavesTheSurfaceThatAProbeLiesOn) {
  SceneBuilder b;
  const uint32_t grey = b.material(Vec3f(0.5f));
  b.quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2}, grey);  // a sheet in the middle
  b.camera({1, 0.5f, 1}, {-1, -0.5f, 1});
  b.scene().bounds = {Vec3f(-1), Vec3f(1)};
  Place place(b.finish());
  const SceneDistance distance(*place.scene.geometry);
  const ProbeLayout layout = placeProbes("relocated", place.input(27));
  EXPECT_EQ(layout.positions.size(), 27u);
  // 0.1 of the smallest spacing is asked for; a step that gains half of it is enough.
  for (const Vec3f& p : layout.positions)
    EXPECT_GE(distance.clearance(p), 0.0499f * layout.bias_length_m) << layout.bias_length_m << p.x << " " << p.y << " " << p.z;
}

TEST(Relocated, DoesNotDependOnTheUnit) {
  Place metres(pillarRoom()), kilometres(pillarRoom(1024));  // a power of two: no rounding
  const ProbeLayout a = placeProbes("relocated", metres.input(100));
  const ProbeLayout b = placeProbes("relocated", kilometres.input(100));
  ASSERT_EQ(a.positions.size(), b.positions.size());
  for (std::size_t i = 0; i < a.positions.size(); ++i)
    EXPECT_LT(length(a.positions[i] * 1024.0f - b.positions[i]), 1024 * 1e-4f);
}

#endif

// Every count, as the header defines the best one.
Vec3i slowCounts(const Vec3f& edges, int probes) {
  const double log_edge[3] = {std::log(edges.x), std::log(edges.y), std::log(edges.z)};
  std::tuple<double, int> best{1e9, 0};
  Vec3i result;
  for (int x = 1; x <= probes; ++x)
    for (int y = 1; y <= probes; ++y)
      for (int z = 1; z <= probes; ++z) {
        const int n[3] = {x, y, z}, points = x * y * z;
        if (points > probes || points < 0.9 * probes) continue;
        double logs[3], mean = 0, spread = 0;
        for (int a = 0; a < 3; ++a) {
          logs[a] = log_edge[a] - std::log(std::max(n[a] - 1, 1));
          mean += logs[a] / 3;
        }
        for (const double l : logs) spread += (l - mean) * (l - mean);
        if (spread < std::get<0>(best) - 1e-9 ||
            (spread < std::get<0>(best) + 1e-9 && points > std::get<1>(best)))
          best = {spread, points}, result = {x, y, z};
      }
  return result;
}

TEST(CubicCounts, AreThoseOfASearchThroughAll) {
  for (const Vec3f& edges : {Vec3f(4, 3, 5), Vec3f(10, 2.5f, 10), Vec3f(1, 1, 1)})
    for (const int probes : {1, 2, 7, 64, 90}) {
      EXPECT_EQ(cubicCounts(edges, probes), slowCounts(edges, probes));
      const std::vector<Vec3i> likely = likelyCounts(edges, probes, 5);
      EXPECT_NE(std::ranges::find(likely, cubicCounts(edges, probes)), likely.end());
    }
  EXPECT_EQ(cubicCounts({4, 4, 4}, 48, 2), cubicCounts({4, 2, 4}, 48));
}

// One and two points leave cells of one length between them, so that only the share of the box tells.
TEST(CubicCounts, TwoProbesDivideTheLongestAxis) {
  EXPECT_EQ(cubicCounts({8, 2, 2}, 2), Vec3i(2, 1, 1));
  EXPECT_EQ(cubicCounts({2, 8, 2}, 2), Vec3i(1, 2, 1));
  EXPECT_EQ(cubicCounts({2, 3, 8}, 2), Vec3i(1, 1, 2));
  EXPECT_EQ(likelyCounts({8, 2, 2}, 2, 1).front(), Vec3i(2, 1, 1));
}

TEST(LatticeIn, KeepsItsInset) {
  Place place(emptySpace());
  const Lattice half = latticeIn(place.input(8), {false, 0.5}, {4, 2, 1});
  EXPECT_NEAR(half.first.x, -0.75f, 1e-6);  // spacing 2 / 4
  EXPECT_NEAR(half.first.y, -0.5f, 1e-6);
  EXPECT_NEAR(half.first.z, 0, 1e-6);
  const Lattice margin = latticeIn(place.input(8), {false, 0, 0.12}, {3, 3, 3});
  EXPECT_NEAR(margin.first.x, -0.88f, 1e-6);
  EXPECT_NEAR(margin.spacing.x, 0.88f, 1e-6);
}

TEST(Grid, OffsetMovesTheWholeLattice) {
  Place place(emptySpace());
  const auto probes = [&](const char* offset) {
    return placeProbes("grid", place.input(8, 1, {{"box", "free"}, {"offset", offset}})).positions;
  };
  const std::vector<Vec3f> still = probes("0"), moved = probes("0.04");
  ASSERT_EQ(still.size(), 8u);
  ASSERT_EQ(moved.size(), 8u);
  // Two probes in 2 m less 0.05 spacings at both ends: 2 / 1.1 m apart, and all stay inside.
  for (std::size_t i = 0; i < still.size(); ++i)
    EXPECT_LT(length(moved[i] - still[i] - Vec3f(0.04f * 2 / 1.1f)), 1e-6f);
  EXPECT_EQ(probes("0.5").size(), 1u);  // the others have left the space
}

TEST(Options, ResolveToDefaultsAndRejectWhatIsWrong) {
  const Strategy& grid = findStrategy("grid");
  const OptionValues values = resolveOptions(grid, {"vertical=2"});
  EXPECT_EQ(values.at("vertical"), "2");
  EXPECT_EQ(values.at("box"), "free");
  const auto message = [](const auto& run) -> std::string {
    try {
      run();
    } catch (const InputError& e) {
      return e.what();
    }
    return "nothing thrown";
  };
  const auto has = [&](const std::string& text, const std::string& part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  has(message([&] { resolveOptions(grid, {"vertcal=2"}); }), "vertical");
  has(message([&] { resolveOptions(grid, {"vertical=2", "vertical=2"}); }), "twice");
  has(message([&] { resolveOptions(grid, {"vertical"}); }), "NAME=VALUE");
  has(message([&] { findStrategy("gird"); }), "grid");
  Place place(emptySpace());
  for (const char* bad : {"9", "0", "nan", "1x", "", "-1", "inf"})
    has(message([&] { placeProbes("grid", place.input(8, 1, {{"vertical", bad}})); }), "vertical");
  has(message([&] { placeProbes("grid", place.input(8, 1, {{"box", "fre"}})); }), "free");
  has(message([&] { placeProbes("grid", place.input(8, 1, {{"boxx", "free"}})); }), "box");
  has(message([&] { placeProbes("grid", place.input(0)); }), "--probes 0");
  has(message([&] { placeProbes("poisson", place.input(8, 1, {{"k", "-1"}})); }), "k=-1");
}

}  // namespace
}  // namespace probelab::test
