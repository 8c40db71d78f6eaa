// SPDX-License-Identifier: GPL-3.0-or-later
// The index of nearest active probes against a search through all of them.
#include <gtest/gtest.h>

#include <limits>

#include "base/rng.h"
#include "ddgi/probe_states.h"

namespace probelab {
namespace {

struct Case {
  ProbeLayout layout;
  ProbeStates states;
};

// Some lattice points store no probe, some probes are inactive.
Case randomCase(const Vec3i& count, const Vec3f& spacing, double stored, double active,
                uint64_t seed) {
  Rng rng(seed, RngStream::test);
  const Lattice lattice{Vec3f(-1, 2, 0.5f), spacing, count};
  std::vector<uint8_t> keep;
  for (int i = 0; i < lattice.pointCount(); ++i) keep.push_back(rng.nextDouble() < stored ? 1 : 0);
  Case c;
  c.layout = latticeLayout(lattice, {Vec3f(-2), Vec3f(30)}, keep);
  c.states = initialStates(c.layout);
  for (uint8_t& a : c.states.active) a = rng.nextDouble() < active ? 1 : 0;
  return c;
}

// [lattice point]: distances to all active probes' lattice points; the first of the smallest.
void expectNearest(const Case& c, const std::string& what) {
  const std::vector<int> active = activeIndex(c.layout, c.states);
  const std::vector<int> nearest = nearestIndex(c.layout, c.states);
  ASSERT_EQ(nearest.size(), active.size());
  for (std::size_t i = 0; i < active.size(); ++i) {
    float least = std::numeric_limits<float>::infinity();
    for (std::size_t j = 0; j < active.size(); ++j) {
      if (active[j] < 0) continue;
      const Vec3f d = c.layout.lattice.position(static_cast<int>(i)) -
                      c.layout.lattice.position(static_cast<int>(j));
      least = std::min(least, dot(d, d));
    }
    if (nearest[i] < 0) {
      EXPECT_EQ(least, std::numeric_limits<float>::infinity()) << what;
      continue;
    }
    EXPECT_EQ(c.states.active[static_cast<std::size_t>(nearest[i])], 1) << what;
    const Vec3f d = c.layout.lattice.position(static_cast<int>(i)) -
                    c.layout.positions[static_cast<std::size_t>(nearest[i])];
    // Equal distances may differ in the last place by the order of the sums.
    EXPECT_LE(dot(d, d), least * 1.00001f) << what << " point " << i;
  }
}

TEST(NearestIndex, EqualsASearchThroughAllProbes) {
  uint64_t seed = 0;
  for (const Vec3i& count : {Vec3i(1, 1, 1), Vec3i(2, 1, 3), Vec3i(7, 5, 4), Vec3i(9, 9, 9)})
    for (const Vec3f& spacing : {Vec3f(1), Vec3f(0.3f, 1.7f, 0.9f)})
      for (const double active : {1.0, 0.5, 0.1, 0.02})
        expectNearest(randomCase(count, spacing, 0.9, active, ++seed),
                      "case " + std::to_string(seed));
}

// What stands in the way of the hand-over between neighbours: a long spiral without active probes.
TEST(NearestIndex, ReachesAcrossEmptyRegions) {
  Case c = randomCase(Vec3i(15, 15, 1), Vec3f(1, 1.5f, 1), 1, 1, 5);
  std::fill(c.states.active.begin(), c.states.active.end(), uint8_t{0});
  c.states.active[0] = c.states.active[14] = c.states.active[7 * 15 + 7] = 1;
  expectNearest(c, "three probes");
}

TEST(NearestIndex, WithoutAnActiveProbeThereIsNone) {
  Case c = randomCase(Vec3i(3, 3, 3), Vec3f(1), 1, 1, 6);
  std::fill(c.states.active.begin(), c.states.active.end(), uint8_t{0});
  for (const int probe : nearestIndex(c.layout, c.states)) EXPECT_EQ(probe, -1);
  for (const int probe : activeIndex(c.layout, c.states)) EXPECT_EQ(probe, -1);
}

TEST(NearestIndex, AnActiveProbeIsItsOwn) {
  const Case c = randomCase(Vec3i(4, 3, 5), Vec3f(1, 2, 3), 0.8, 0.5, 7);
  const std::vector<int> active = activeIndex(c.layout, c.states);
  const std::vector<int> nearest = nearestIndex(c.layout, c.states);
  for (std::size_t i = 0; i < active.size(); ++i)
    if (active[i] >= 0) {
      EXPECT_EQ(nearest[i], active[i]);
    }
}

}  // namespace
}  // namespace probelab
