// SPDX-License-Identifier: GPL-3.0-or-later
// The layout report against hand-counted cases.
#include "placement/report.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "placement/grid.h"
#include "places.h"

namespace probelab::test {
namespace {

// 2 x 2 x 2 probes 0.5 m from the walls of a room of 3 m.
struct EightProbes {
  EightProbes() : place(make()) {
    const Lattice lattice = makeLattice({{0.5f, 0.5f, 0.5f}, {2.5f, 2.5f, 2.5f}}, {2, 2, 2});
    layout = latticeLayout(lattice, place.scene.bounds, std::vector<uint8_t>(8, 1));
  }
  static Scene make() {
    SceneBuilder b;
    b.box({0, 0, 0}, {3, 3, 3}, b.material(Vec3f(0.5f)), true);
    b.camera({1, 1, 1}, {2, 2, 2});
    return b.finish();
  }
  Place place;
  ProbeLayout layout;
};

TEST(LayoutReport, CountsWhatReachesThePoints) {
  EightProbes e;
  // In the cell 8 probes count, at its corner 1, on its edge 2, on its face 4, at a probe's height
  // beyond the lattice what the clamped place says.
  const std::vector<Vec3f> points = {
      {1, 1, 1}, {0.5f, 0.5f, 0.5f}, {1, 0.5f, 0.5f}, {1, 1, 0.5f}, {0, 0, 0}};
  const LayoutReport report = layoutReport(e.layout, e.place.scene, e.place.embree, points);
  EXPECT_EQ(report.stored, 8u);
  EXPECT_EQ(report.inside_geometry, 0u);
  EXPECT_DOUBLE_EQ(report.reached[0], 0);
  EXPECT_DOUBLE_EQ(report.reached[1], 1);
  EXPECT_DOUBLE_EQ(report.reached[2], 0.6);
  EXPECT_DOUBLE_EQ(report.reached[3], 0.4);
  EXPECT_DOUBLE_EQ(report.reached[4], 0.2);
  EXPECT_NEAR(report.spacing_m.min, 2, 1e-6);
  EXPECT_NEAR(report.spacing_m.max, 2, 1e-6);
  EXPECT_EQ(report.index_bytes, indexBytes(e.layout));
#ifdef PROBELAB_WITH_CGAL
  EXPECT_TRUE(report.has_clearance);
  EXPECT_NEAR(report.clearance_m.median, 0.5, 1e-6);
#endif
}

TEST(LayoutReport, HiddenProbesDoNotReach) {
  Place place(twoRooms());
  const Lattice lattice = makeLattice({{-1, 1, 1}, {1, 2, 2}}, {2, 1, 1});
  const ProbeLayout layout = latticeLayout(lattice, place.scene.bounds, {1, 1});
  const std::vector<Vec3f> points = {{-0.5f, 1, 1}, {0.5f, 1, 1}};
  const LayoutReport report = layoutReport(layout, place.scene, place.embree, points);
  EXPECT_DOUBLE_EQ(report.reached[1], 1);
  EXPECT_DOUBLE_EQ(report.reached[2], 0);
}

TEST(LayoutReport, CountsProbesInsideGeometry) {
  Place place(pillarRoom());
  const Lattice lattice = makeLattice({{1, 1, 2.4f}, {2, 2, 2.6f}}, {2, 1, 1});
  const ProbeLayout layout = latticeLayout(lattice, place.scene.bounds, {1, 1});
  EXPECT_EQ(layoutReport(layout, place.scene, place.embree, {}).inside_geometry, 1u);
}

TEST(WeightsAt, OfScatteredProbesSumToOne) {
  Place place(pillarRoom());
  const ProbeLayout layout = placeProbes("poisson", place.input(50));
  Rng rng(1, RngStream::test);
  for (int i = 0; i < 300; ++i) {
    const Vec3f p(4 * rng.nextFloat(), 3 * rng.nextFloat(), 5 * rng.nextFloat());
    double sum = 0;
    for (const CornerWeight& w : weightsAt(layout, p)) {
      EXPECT_GT(w.weight, 0);
      sum += static_cast<double>(w.weight);
    }
    // Each corner's sum is 1 but for the rounding of the roots of its at most 8 weights to 1 / 128,
    // sqrt(w) / 128 each.
    EXPECT_NEAR(sum, 1, std::sqrt(8.0) / 128);
  }
}

}  // namespace
}  // namespace probelab::test
