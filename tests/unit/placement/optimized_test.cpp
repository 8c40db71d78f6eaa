// SPDX-License-Identifier: GPL-3.0-or-later
// What `optimized` learns from and what checks it.
#include <gtest/gtest.h>

#include <algorithm>

#ifdef PROBELAB_WITH_CGAL
#include "placement/training_data.h"
#include "places.h"

namespace probelab::test {
namespace {

constexpr int kProbes = 27;

ProbeLayout optimize(Place& place, std::vector<std::string> pairs) {
  for (const char* quick : {"start=sparse", "proposals=8", "pool=4", "pool_least=0", "fit=4"})
    pairs.push_back(quick);
  return placeProbes("optimized",
                     place.input(kProbes, 1, resolveOptions(findStrategy("optimized"), pairs)));
}

// 6 x 0.4 x 0.4 m: less room than two gaps of 0.4 spacings.
Scene duct() {
  SceneBuilder b;
  b.shell(Vec3f(0), Vec3f(6, 0.4f, 0.4f), 0.1f, b.material(Vec3f(0.6f)), b.material(Vec3f(0.6f)));
  b.pointLight(Vec3f(1, 0.3f, 0.2f), Vec3f(1));
  b.camera(Vec3f(1, 0.2f, 0.2f), Vec3f(5, 0.2f, 0.2f));
  return b.finish();
}

ProbeLayout startOf(Place& place) {
  return placeProbes("grid_sparse", place.input(kProbes, 1, {{"sweep", "off"}}));
}

// A cost of gaps above everything else spreads the probes, whatever that does to the error.
TEST(Optimized, GivesWayToAStartThatOtherLightsSayIsBetter) {
  Place place(corridor());
  const ProbeLayout start = startOf(place);
  const ProbeLayout checked = optimize(place, {"generated=1", "coverage=1e6"});
  const ProbeLayout unchecked = optimize(place, {"generated=1", "coverage=1e6", "check=off"});
  ASSERT_GT(place.training.score(unchecked, place.params),
            place.training.score(start, place.params));
  EXPECT_EQ(checked.positions, start.positions);
  EXPECT_EQ(checked.strategy, "optimized");
  EXPECT_EQ(checked.options.at("coverage"), "1e6");  // its own, not those of the start
  EXPECT_NE(unchecked.positions, start.positions);
}

TEST(Optimized, ForItsOwnLightsSeesNoOthers) {
  Place place(corridor());
  const std::vector<Vec3f> one = optimize(place, {"lights=own", "generated=1"}).positions;
  EXPECT_EQ(one, optimize(place, {"lights=own", "generated=9"}).positions);
  EXPECT_NE(one, optimize(place, {"lights=all", "generated=9", "check=off"}).positions);
}

TEST(Optimized, MovesInTheMiddleOfNarrowPlaces) {
  Place place(duct());
  const std::vector<Vec3f> start = startOf(place).positions;
  const std::vector<Vec3f> moved =
      optimize(place, {"generated=1", "wall_gap=0.4", "check=off"}).positions;
  int elsewhere = 0;
  for (const Vec3f& p : moved) {
    if (std::ranges::find(start, p) != start.end()) continue;
    ++elsewhere;
    for (const float x : {p.y, p.z}) {
      EXPECT_GE(x, 0.1f - 1e-5f);
      EXPECT_LE(x, 0.3f + 1e-5f);
    }
  }
  EXPECT_GT(elsewhere, 0);
}

TEST(Optimized, OwnStatesScoreAlone) {
  Place place(corridor());
  const ProbeLayout start = startOf(place);
  const Training::Data& data = place.training.data();
  ASSERT_EQ(data.stateCount(), 2u);
  const std::vector<double> errors =
      squaredErrors(data, estimateLayout(data, start, place.params));
  ASSERT_TRUE(data.patches->lighting()[0].own);
  EXPECT_DOUBLE_EQ(place.training.score(start, place.params, true), std::sqrt(errors[0]));
  EXPECT_DOUBLE_EQ(place.training.score(start, place.params),
                   std::sqrt((errors[0] + errors[1]) / 2));
}

}  // namespace
}  // namespace probelab::test
#endif  // PROBELAB_WITH_CGAL
