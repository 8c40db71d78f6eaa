// SPDX-License-Identifier: GPL-3.0-or-later
// The interpolants of scattered probes: partition, locality, degenerate positions, linear fields.
#include "placement/corner_weights.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "placement/barycentric.h"
#include "placement/nearest_probes.h"
#include "places.h"

namespace probelab::test {
namespace {

std::vector<Vec3f> randomPoints(const Box3f& box, int count, uint64_t seed) {
  Rng rng(seed, RngStream::test);
  std::vector<Vec3f> points(static_cast<std::size_t>(count));
  for (Vec3f& p : points)
    for (std::size_t axis = 0; axis < 3; ++axis)
      p[axis] = box.min[axis] + rng.nextFloat() * (box.max[axis] - box.min[axis]);
  return points;
}

double weightSum(const std::vector<CornerWeight>& weights) {
  return std::accumulate(
      weights.begin(), weights.end(), 0.0,
      [](double sum, const CornerWeight& w) { return sum + static_cast<double>(w.weight); });
}

// Weighted mean position: the corner itself where linear fields are reproduced.
Vec3d meanPosition(const std::vector<CornerWeight>& weights, const std::vector<Vec3f>& positions) {
  Vec3d mean;
  for (const CornerWeight& w : weights)
    mean += Vec3d(positions[w.probe]) * static_cast<double>(w.weight);
  return mean / weightSum(weights);
}

TEST(NearestProbes, AreThoseOfASearchThroughAll) {
  std::vector<Vec3f> points = randomPoints({{0, 0, 0}, {1, 2, 0.1f}}, 300, 5);
  points[7] = points[3];
  const NearestProbes tree(points);
  std::vector<NearProbe> found;
  for (const Vec3f& p : randomPoints({{-1, -1, -1}, {2, 2, 2}}, 50, 6)) {
    std::vector<NearProbe> all;
    for (uint32_t i = 0; i < points.size(); ++i) all.push_back({length(points[i] - p), i});
    std::sort(all.begin(), all.end());
    for (const std::size_t count : {std::size_t{1}, std::size_t{9}, std::size_t{300}}) {
      tree.nearest(p, count, found);
      ASSERT_EQ(found.size(), count);
      EXPECT_TRUE(std::equal(found.begin(), found.end(), all.begin()));
    }
    tree.nearest(p, 1000, found);
    EXPECT_EQ(found.size(), points.size());
  }
}

TEST(InfluenceCorners, AreAboutHalfASpacingApartAndBounded) {
  const Lattice corners = influenceCorners({{0, 0, 0}, {4, 2, 1}}, 0.5);
  EXPECT_EQ(corners.count, Vec3i(17, 9, 5));
  const Lattice flat = influenceCorners({{0, 0, 0}, {4, 1e-4f, 4}}, 1);
  EXPECT_EQ(flat.count.y, 3);
  EXPECT_LE(influenceCorners({{0, 0, 0}, {1, 1, 1}}, 1e-5).pointCount(), 2000000);
}

TEST(InfluenceBox, IsTheRoomHoweverLargeTheVolume) {
  Scene wide = pillarRoom();
  wide.bounds = {Vec3f(-14), Vec3f(18)};
  Place tight(pillarRoom()), far(std::move(wide));
  std::array<Vec3i, 2> counts;
  for (Place* place : {&tight, &far}) {
    const Box3f box = influenceBox(place->input(60), 1);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float end = std::array{4.0f, 3.0f, 5.0f}[axis];
      EXPECT_NEAR(box.min[axis], 0.075f, 1e-4f);
      EXPECT_NEAR(box.max[axis], end - 0.075f, 1e-4f);
    }
    const ProbeLayout layout = placeProbes("poisson", place->input(60));
    counts[place == &far ? 1 : 0] = layout.influence.corners.count;
    const Box3f& bounds = place->scene.bounds;
    EXPECT_EQ(layout.bounds.min, bounds.min);
    EXPECT_EQ(layout.bounds.max, bounds.max);
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    EXPECT_LE(std::abs(counts[0][axis] - counts[1][axis]), 1);
}

TEST(NearestWeights, CountOnlyProbesThatTheCornerSees) {
  Place place(twoRooms());
  const PlacementInput input = place.input(60);
  const FreeSpace space(input);
  std::vector<Vec3f> positions = randomPoints({{-3, 0.05f, 0.05f}, {-0.1f, 2.9f, 2.9f}}, 30, 1);
  const std::vector<Vec3f> right = randomPoints({{0.1f, 0.05f, 0.05f}, {3, 2.9f, 2.9f}}, 30, 2);
  positions.insert(positions.end(), right.begin(), right.end());
  const Lattice corners = influenceCorners(place.scene.bounds, 0.9);
  const CornerWeights weights = nearestWeights(corners, positions, space, {});
  int filled = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const Vec3f corner = corners.position(static_cast<int>(i));
    const bool free = std::abs(corner.x) > 0.06f && std::abs(corner.x) < 3.04f &&
                      corner.y > 0.01f && corner.y < 2.99f && corner.z > 0.01f && corner.z < 2.99f;
    if (free) EXPECT_FALSE(weights[i].empty());
    if (weights[i].empty()) continue;
    ++filled;
    EXPECT_LE(weights[i].size(), 8u);
    for (const CornerWeight& w : weights[i]) {
      EXPECT_GT(w.weight, 0);
      EXPECT_EQ(corner.x < 0, positions[w.probe].x < 0);
    }
  }
  EXPECT_GT(filled, 100);
  // Without visibility the wall does not count.
  const CornerWeights blind = nearestWeights(corners, positions, space, {8, false});
  bool across = false;
  for (std::size_t i = 0; i < blind.size(); ++i)
    for (const CornerWeight& w : blind[i])
      across |= (corners.position(static_cast<int>(i)).x < 0) != (positions[w.probe].x < 0);
  EXPECT_TRUE(across);
}

TEST(Viewpoints, OfACornerInAWallLieOnBothSides) {
  Place place(twoRooms());
  const PlacementInput input = place.input(8);
  const FreeSpace space(input);
  // The middle corner lies in the wall between the rooms, its voxels reach 0.5 m into each.
  const Lattice corners = makeLattice({{-0.5f, 0.5f, 0.5f}, {0.5f, 2.5f, 2.5f}}, {3, 3, 3});
  int left = 0, right = 0;
  for (const Vec3f& p : viewpoints(corners, 13, space)) {
    EXPECT_TRUE(space.usable(p));
    (p.x < 0 ? left : right) += 1;
  }
  EXPECT_EQ(left, 4);
  EXPECT_EQ(right, 4);
  EXPECT_EQ(viewpoints(corners, 12, space), std::vector<Vec3f>{Vec3f(-0.5f, 1.5f, 1.5f)});
  const std::vector<Vec3f> positions = {{-1, 1.5f, 1.5f}, {1, 1.5f, 1.5f}};
  EXPECT_EQ(nearestWeights(corners, positions, space, {})[13].size(), 2u);
  EXPECT_EQ(nearestWeights(corners, positions, space, {})[12].size(), 1u);
}

TEST(NearestWeights, FallToZeroAtTheNextProbesDistance) {
  Place place(emptySpace());
  const PlacementInput input = place.input(3);
  const FreeSpace space(input);
  const std::vector<Vec3f> positions = {{0.1f, 0, 0}, {0.3f, 0, 0}, {0.5f, 0, 0}};
  const Lattice corners = makeLattice({{0, -1, -1}, {1, 1, 1}}, {2, 3, 3});
  const CornerWeights weights = nearestWeights(corners, positions, space, {2, true});
  const auto& at = weights[2 * (3 + 1)];  // the corner at 0, 0, 0
  ASSERT_EQ(at.size(), 2u);
  EXPECT_NEAR(at[0].weight, (1 - 0.2) * (1 - 0.2), 1e-6);  // (1 - 0.1 / 0.5)^2
  EXPECT_NEAR(at[1].weight, (1 - 0.6) * (1 - 0.6), 1e-6);
  // With k = 3 there is no fourth: r is twice the third's distance.
  const CornerWeights open = nearestWeights(corners, positions, space, {3, true});
  ASSERT_EQ(open[8].size(), 3u);
  EXPECT_NEAR(open[8][2].weight, 0.25, 1e-6);
}

TEST(NearestWeights, KeepProbesAtEqualDistance) {
  Place place(emptySpace());
  const PlacementInput input = place.input(8);
  const FreeSpace space(input);
  std::vector<Vec3f> positions;
  for (int i = 0; i < 8; ++i)
    positions.emplace_back(i & 1 ? 0.5f : -0.5f, i & 2 ? 0.5f : -0.5f, i & 4 ? 0.5f : -0.5f);
  const Lattice corners = makeLattice({{-1, -1, -1}, {1, 1, 1}}, {3, 3, 3});
  for (const int k : {1, 4, 8})
    EXPECT_EQ(nearestWeights(corners, positions, space, {k, true})[13].size(),
              static_cast<std::size_t>(k));
}

// Fewer probes, about the same centre: dropping the others alone would move it.
TEST(NearestWeights, MaximumEntropyIsCentredWithFewProbesToo) {
  Place place(emptySpace());
  const PlacementInput input = place.input(60);
  const FreeSpace space(input);
  const std::vector<Vec3f> positions = randomPoints({{-1, -1, -1}, {1, 1, 1}}, 60, 3);
  const NearestProbes probes(positions);
  double all_count = 0, few_count = 0, all_off = 0, few_off = 0, dropped_off = 0;
  for (const Vec3f& p : randomPoints({{-0.5f, -0.5f, -0.5f}, {0.5f, 0.5f, 0.5f}}, 200, 4)) {
    const CornerSettings settings = {.k = 16, .sharpness = 10, .cutoff = 0};
    CornerSettings cut = settings;
    cut.cutoff = 0.05;
    const auto all = nearestFrom(probes, positions, space, {p}, settings);
    const auto few = nearestFrom(probes, positions, space, {p}, cut);
    EXPECT_NEAR(weightSum(few), 1, 1e-5);
    for (const CornerWeight& w : few) EXPECT_GT(w.weight, 0);
    auto dropped = all;
    std::erase_if(dropped, [](const CornerWeight& w) { return w.weight <= 0.05f; });
    EXPECT_EQ(few.size(), dropped.size());
    all_count += static_cast<double>(all.size()), few_count += static_cast<double>(few.size());
    all_off += length(meanPosition(all, positions) - Vec3d(p));
    few_off += length(meanPosition(few, positions) - Vec3d(p));
    dropped_off += length(meanPosition(dropped, positions) - Vec3d(p));
  }
  EXPECT_LT(few_count, 0.6 * all_count);
  EXPECT_LT(few_off - all_off, 0.6 * (dropped_off - all_off));
  // A cutoff above every share leaves the largest.
  CornerSettings one = {.k = 16, .sharpness = 10, .cutoff = 1};
  EXPECT_EQ(nearestFrom(probes, positions, space, {Vec3f(0.1f)}, one).size(), 1u);
}

#ifdef PROBELAB_WITH_CGAL

void expectPartition(const CornerWeights& weights, std::size_t probes) {
  for (const auto& at : weights) {
    ASSERT_FALSE(at.empty());
    EXPECT_NEAR(weightSum(at), 1, 1e-6);
    for (const CornerWeight& w : at) {
      EXPECT_GE(w.weight, 0);
      EXPECT_TRUE(std::isfinite(w.weight));
      EXPECT_LT(w.probe, probes);
    }
  }
}

TEST(BarycentricWeights, ReproduceLinearFieldsInsideTheHull) {
  std::vector<Vec3f> positions = randomPoints({{-1, -1, -1}, {1, 1, 1}}, 80, 11);
  for (int i = 0; i < 8; ++i)
    positions.emplace_back(i & 1 ? 2.0f : -2.0f, i & 2 ? 2.0f : -2.0f, i & 4 ? 2.0f : -2.0f);
  const Lattice corners = makeLattice({{-2, -2, -2}, {2, 2, 2}}, {7, 8, 9});
  const CornerWeights weights = barycentricWeights(corners, positions);
  expectPartition(weights, positions.size());
  for (std::size_t i = 0; i < weights.size(); ++i) {
    EXPECT_LE(weights[i].size(), 4u);
    const Vec3d error =
        meanPosition(weights[i], positions) - Vec3d(corners.position(static_cast<int>(i)));
    EXPECT_LT(length(error), 2e-6);  // weights are floats: 4 roundings of 6e-8 times 3.5
  }
}

TEST(BarycentricWeights, OutsideTheHullAreThoseOfItsClosestPoint) {
  const std::vector<Vec3f> positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const Lattice corners = makeLattice({{-1, -1, -1}, {3, 3, 3}}, {9, 9, 9});
  const CornerWeights weights = barycentricWeights(corners, positions);
  expectPartition(weights, 4);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    // Projection on the simplex by brute force: no point of a fine sampling is nearer.
    const Vec3d p(corners.position(static_cast<int>(i)));
    const double reached = length(meanPosition(weights[i], positions) - p);
    double best = 1e9;
    const int n = 20;
    for (int a = 0; a <= n; ++a)
      for (int b = 0; a + b <= n; ++b)
        for (int c = 0; a + b + c <= n; ++c)
          best = std::min(best, length(Vec3d(a, b, c) / static_cast<double>(n) - p));
    EXPECT_LE(reached, best + 1e-6);
  }
}

TEST(BarycentricWeights, HandleCosphericalLattices) {
  std::vector<Vec3f> positions;
  const Lattice lattice = makeLattice({{0, 0, 0}, {3, 2, 1}}, {4, 3, 2});
  for (int i = 0; i < lattice.pointCount(); ++i) positions.push_back(lattice.position(i));
  const Lattice corners = makeLattice({{-0.5f, -0.5f, -0.5f}, {3.5f, 2.5f, 1.5f}}, {9, 7, 5});
  const CornerWeights weights = barycentricWeights(corners, positions);
  expectPartition(weights, positions.size());
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const Vec3f p = corners.position(static_cast<int>(i));
    const Vec3f inside = componentMin(componentMax(p, Vec3f(0, 0, 0)), Vec3f(3, 2, 1));
    EXPECT_LT(length(meanPosition(weights[i], positions) - Vec3d(inside)), 1e-6);
  }
}

TEST(BarycentricWeights, HandleCoplanarCollinearFewAndCoincidingPoints) {
  const Lattice corners = makeLattice({{-1, -1, -1}, {2, 2, 2}}, {4, 4, 4});
  std::vector<Vec3f> plane, line;
  for (int i = 0; i < 9; ++i)
    plane.emplace_back(0.5f * static_cast<float>(i % 3), 0.25f, 0.5f * static_cast<float>(i / 3));
  for (int i = 0; i < 5; ++i) line.emplace_back(0.5f, 0.25f * static_cast<float>(i), 0.5f);
  const auto check = [&](const std::vector<Vec3f>& positions, const auto& closest) {
    const CornerWeights weights = barycentricWeights(corners, positions);
    expectPartition(weights, positions.size());
    for (std::size_t i = 0; i < weights.size(); ++i)
      EXPECT_LT(length(meanPosition(weights[i], positions) -
                       Vec3d(closest(corners.position(static_cast<int>(i))))),
                1e-6);
  };
  const auto unit = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
  check(plane, [&](const Vec3f& p) { return Vec3f(unit(p.x), 0.25f, unit(p.z)); });
  check(line, [&](const Vec3f& p) { return Vec3f(0.5f, unit(p.y), 0.5f); });
  check({{0, 0, 0}, {1, 0, 0}}, [&](const Vec3f& p) { return Vec3f(unit(p.x), 0, 0); });
  check({{0.5f, 0, 0}}, [&](const Vec3f&) { return Vec3f(0.5f, 0, 0); });
  check({{0.5f, 0, 0}, {0.5f, 0, 0}}, [&](const Vec3f&) { return Vec3f(0.5f, 0, 0); });
  // Twins share what one would have.
  const std::vector<Vec3f> twins = {{0, 0, 0}, {1, 0, 0}, {1, 0, 0}};
  const CornerWeights weights = barycentricWeights(corners, twins);
  for (const auto& at : weights) {
    float second = 0, third = 0;
    for (const CornerWeight& w : at)
      (w.probe == 1 ? second : w.probe == 2 ? third : second) += w.probe == 0 ? 0 : w.weight;
    EXPECT_EQ(second, third);
  }
}

TEST(TetrahedraWeights, DropWhatTheCornerDoesNotSee) {
  Place place(twoRooms());
  const PlacementInput input = place.input(40);
  const FreeSpace space(input);
  std::vector<Vec3f> positions = randomPoints({{-3, 0.05f, 0.05f}, {-0.1f, 2.9f, 2.9f}}, 20, 1);
  const std::vector<Vec3f> right = randomPoints({{0.1f, 0.05f, 0.05f}, {3, 2.9f, 2.9f}}, 20, 2);
  positions.insert(positions.end(), right.begin(), right.end());
  const Lattice corners = influenceCorners(place.scene.bounds, 0.9);
  const CornerWeights weights = tetrahedraWeights(corners, positions, space, {});
  for (std::size_t i = 0; i < weights.size(); ++i)
    for (const CornerWeight& w : weights[i])
      EXPECT_EQ(corners.position(static_cast<int>(i)).x < 0, positions[w.probe].x < 0);
}

#endif

TEST(NaturalWeights, ReproduceLinearFieldsInsideTheHull) {
  Place place(emptySpace());
  const PlacementInput input = place.input(8);
  const FreeSpace space(input);
  std::vector<Vec3f> positions = randomPoints(place.scene.bounds, 120, 21);
  const Lattice corners = influenceCorners(place.scene.bounds, space.spacing(120), 3);
  const CornerWeights weights = naturalWeights(corners, positions, space, {});
  const auto spacing = static_cast<float>(space.spacing(120));
  double sum_sq = 0, nearest_sq = 0;
  int counted = 0;
  const NearestProbes probes(positions);
  std::vector<NearProbe> nearest;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const Vec3f p = corners.position(static_cast<int>(i));
    ASSERT_FALSE(weights[i].empty());
    // Well inside: no cell that is cut by the box takes part.
    if (std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > 1 - 1.5f * spacing) continue;
    const Vec3d error = meanPosition(weights[i], positions) - Vec3d(p);
    sum_sq += dot(error, error);
    probes.nearest(p, 1, nearest);
    nearest_sq += static_cast<double>(nearest[0].distance_m * nearest[0].distance_m);
    ++counted;
  }
  ASSERT_GT(counted, 50);
  // Sibson's coordinates are exact; counting samples a twelfth of a spacing apart leaves a few
  // per cent of the spacing. The nearest probe alone is off by half a spacing.
  EXPECT_LT(std::sqrt(sum_sq / counted), 0.03 * static_cast<double>(spacing));
  EXPECT_GT(std::sqrt(nearest_sq / counted), 0.3 * static_cast<double>(spacing));
}

TEST(NaturalWeights, AtALatticesPositionsComeCloseToTrilinear) {
  Place place(emptySpace());
  const PlacementInput input = place.input(125);
  const FreeSpace space(input);
  const Lattice lattice = makeLattice({{-1, -1, -1}, {1, 1, 1}}, {5, 5, 5});
  std::vector<Vec3f> positions;
  for (int i = 0; i < lattice.pointCount(); ++i) positions.push_back(lattice.position(i));
  // Corners at the lattice's points and half-way between them.
  const Lattice corners = makeLattice({{-1, -1, -1}, {1, 1, 1}}, {9, 9, 9});
  const CornerWeights weights = naturalWeights(corners, positions, space, {});
  double worst = 0;
  for (int z = 2; z <= 6; ++z)
    for (int y = 2; y <= 6; ++y)
      for (int x = 2; x <= 6; ++x) {
        const auto& at = weights[static_cast<std::size_t>((z * 9 + y) * 9 + x)];
        const Vec3f p = corners.position((z * 9 + y) * 9 + x);
        const double sum = weightSum(at);
        for (const CornerWeight& w : at) {
          const Vec3f d = positions[w.probe] - p;
          double trilinear = 1;
          for (std::size_t axis = 0; axis < 3; ++axis)
            trilinear *= std::max(0.0, 1 - std::abs(static_cast<double>(d[axis])) / 0.5);
          worst = std::max(worst, std::abs(static_cast<double>(w.weight) / sum - trilinear));
        }
      }
  // On the lattice and in the middles of edges, faces and cells symmetry leaves Sibson's weights no
  // choice among the nearest; farther probes get a little in the middle of edges.
  EXPECT_LT(worst, 0.15);
}

TEST(NaturalWeights, StayInTheirRoom) {
  Place place(twoRooms());
  const PlacementInput input = place.input(40);
  const FreeSpace space(input);
  std::vector<Vec3f> positions = randomPoints({{-3, 0.05f, 0.05f}, {-0.1f, 2.9f, 2.9f}}, 20, 1);
  const std::vector<Vec3f> right = randomPoints({{0.1f, 0.05f, 0.05f}, {3, 2.9f, 2.9f}}, 20, 2);
  positions.insert(positions.end(), right.begin(), right.end());
  const Lattice corners = influenceCorners(place.scene.bounds, 0.9);
  const CornerWeights weights = naturalWeights(corners, positions, space, {});
  std::size_t filled = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    filled += weights[i].empty() ? 0 : 1;
    for (const CornerWeight& w : weights[i])
      EXPECT_EQ(corners.position(static_cast<int>(i)).x < 0, positions[w.probe].x < 0);
  }
  EXPECT_GT(filled, 100u);
}

}  // namespace
}  // namespace probelab::test
