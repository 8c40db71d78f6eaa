// SPDX-License-Identifier: GPL-3.0-or-later
// The worked example of README: a strategy in one file, through the interface alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/files.h"
#include "places.h"

namespace probelab {
extern const Strategy kLayersStrategy;
}

namespace probelab::test {
namespace {

ProbeLayout place(Place& where, int probes, const std::vector<std::string>& options = {}) {
  return kLayersStrategy.place(where.input(probes, 1, resolveOptions(kLayersStrategy, options)));
}

TEST(ExampleStrategy, TwoLayersWithinTheBudget) {
  Place where(pillarRoom());
  for (const int probes : {1, 2, 8, 64, 512}) {
    const ProbeLayout layout = place(where, probes, {"low=0.7"});
    EXPECT_NO_THROW(validateLayout(layout, where.params));
    EXPECT_LE(layout.positions.size(), static_cast<std::size_t>(probes));
    EXPECT_GE(layout.positions.size(), static_cast<std::size_t>(probes) / 2);
    std::set<float> heights;
    for (const Vec3f& p : layout.positions) {
      EXPECT_TRUE(isUsable(where.input(probes), p));
      heights.insert(static_cast<float>(toWorld(where.scene, p).y));
    }
    if (layout.positions.size() == 1) continue;  // where there is most room
    ASSERT_EQ(heights.size(), 2u);
    EXPECT_NEAR(*heights.begin(), 0.7f, 1e-3f);  // the floor is found to a cell's share
    EXPECT_NEAR(*heights.rbegin(), 1.6f, 1e-3f);
  }
}

TEST(ExampleStrategy, RefusesWhatItCannotDo) {
  Place where(pillarRoom());
  EXPECT_THROW(place(where, 8, {"low=2"}), InputError);
  EXPECT_THROW(place(where, 8, {"low=nan"}), InputError);
  EXPECT_THROW(place(where, 8, {"middle=1"}), InputError);
}

TEST(ExampleStrategy, IsNoLongerThanTheReadmeSays) {
  const std::string text =
      readTextFile(std::string(PROBELAB_SOURCE_DIR) + "/tests/unit/placement/example_strategy.cpp");
  EXPECT_LT(std::count(text.begin(), text.end(), '\n'), 100);
}

}  // namespace
}  // namespace probelab::test
