// SPDX-License-Identifier: GPL-3.0-or-later
// Curves of precision: how breaking points are found, and that the plans are what they claim.
#include "stability/curves.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "gpu_fixture.h"

namespace probelab {
namespace {

class Curves : public GpuTest {
 protected:
  // A curve of this error over xs, bound 1, easiest at 1.
  Curve measured(const std::vector<double>& xs, double (*error)(double x)) {
    CurvePlan plan{"test.curve", "embree", "", "", "", 1, 1, xs, {}};
    plan.error = [error](Workbench&, double x) { return error(x); };
    const std::vector<Curve> curves = runCurves(gpu(), {plan});
    EXPECT_EQ(curves.size(), 1u);
    return curves.front();
  }
};

TEST_F(Curves, BreakWhereTheErrorLeavesItsBound) {
  const Curve curve = measured({1, 10, 100, 1000}, [](double x) { return x / 70; });
  ASSERT_TRUE(curve.breaks_above);
  EXPECT_NEAR(std::log(*curve.breaks_above / 70), 0, 0.05 + 1e-9);  // half of 10 %
  EXPECT_FALSE(curve.breaks_below);  // no points there
  ASSERT_EQ(curve.points.size(), 4u);
  EXPECT_EQ(curve.points[2].error, 100.0 / 70);
}

TEST_F(Curves, BreakOnBothSidesOfTheEasiest) {
  const Curve curve = measured({1e-2, 0.1, 1, 10, 100}, [](double x) {
    return std::abs(std::log10(x)) / 1.5;  // 1 at 10^-1.5 and 10^1.5
  });
  ASSERT_TRUE(curve.breaks_below && curve.breaks_above);
  EXPECT_NEAR(std::log10(*curve.breaks_below), -1.5, 0.03);
  EXPECT_NEAR(std::log10(*curve.breaks_above), 1.5, 0.03);
}

TEST_F(Curves, ThatHoldToTheEndHaveNoBreakingPoint) {
  const Curve curve = measured({0.1, 1, 10}, [](double) { return 1.0; });
  EXPECT_FALSE(curve.breaks_below);
  EXPECT_FALSE(curve.breaks_above);
}

TEST_F(Curves, ThatNeverHoldBreakAtTheEasiest) {
  const Curve curve = measured({1, 10}, [](double) { return 2.0; });
  EXPECT_EQ(curve.breaks_above, 1.0);
}

TEST_F(Curves, DoNotHoldWhereTheErrorIsNoNumber) {
  const Curve curve = measured({1, 10}, [](double x) { return x > 5 ? NAN : 0.0; });
  ASSERT_TRUE(curve.breaks_above);
  EXPECT_NEAR(*curve.breaks_above, 5, 0.5);
}

// A format ends where its numbers do: half an ulp of rgb10a2 is 1 % at 0.049, the largest
// is 1.
TEST_F(Curves, FindTheEndsOfAFormat) {
  const std::vector<Curve> curves = runCurves(gpu(), planCurves("contrast.rgb10a2"));
  const auto plain = std::find_if(curves.begin(), curves.end(),
                                  [](const Curve& c) { return c.plan.id == "contrast.rgb10a2"; });
  ASSERT_NE(plain, curves.end());
  ASSERT_TRUE(plain->breaks_below && plain->breaks_above);
  EXPECT_NEAR(*plain->breaks_below, 0.5 / 1023 / 0.01, 0.02);
  EXPECT_NEAR(*plain->breaks_above, 1.0, 0.06);
}

// A file's distance is taken into the origin in double: the room there is the room here.
TEST_F(Curves, ARoomOfAFileIsTheSameFarAway) {
  const std::vector<Curve> curves = runCurves(gpu(), planCurves("distance.file"));
  ASSERT_EQ(curves.size(), 1u);
  EXPECT_FALSE(curves.front().breaks_above);
  // World coordinates of 1e6 m round to 2^-34 m; local ones, below 4 m, to 2^-23: 7 bounces of them.
  for (const CurvePoint& p : curves.front().points) EXPECT_LT(p.error, 7 * 0x1p-23) << p.x;
}

TEST(CurvePlans, CoverTheirRanges) {
  const std::vector<CurvePlan> plans = precisionCurves();
  std::set<std::string> ids;
  for (const CurvePlan& plan : plans) {
    EXPECT_TRUE(ids.insert(plan.id).second) << plan.id << " comes twice";
    EXPECT_TRUE(std::is_sorted(plan.xs.begin(), plan.xs.end())) << plan.id;
    EXPECT_GT(plan.bound, 0) << plan.id;
    EXPECT_TRUE(plan.error) << plan.id;
    const bool easy_is_there = std::any_of(plan.xs.begin(), plan.xs.end(), [&](double x) {
      return std::abs(x - plan.easy) <= 1e-12;
    });
    EXPECT_TRUE(easy_is_there) << plan.id;
  }
  const auto range = [&](const std::string& name, double low, double high) {
    for (const CurvePlan& plan : planCurves(name)) {
      EXPECT_NEAR(plan.xs.front() / low, 1, 1e-9) << plan.id;
      EXPECT_NEAR(plan.xs.back() / high, 1, 1e-9) << plan.id;
    }
  };
  range("distance", 1, 1e6);
  range("scale", 1e-4, 1e4);
  range("contrast", 1e-6, 1e6);
  range("wall", 1e-3, 0.5);
  range("albedo", 1e-3, 1);
}

TEST(CurvePlans, AreFoundByNameWithTheNearest) {
  EXPECT_EQ(planCurves("").size(), precisionCurves().size());
  EXPECT_EQ(planCurves("scale.embree").size(), 1u);
  try {
    planCurves("scale.embre3");
    ADD_FAILURE() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("did you mean 'scale.embree'"), std::string::npos)
        << error.what();
  }
  EXPECT_THROW(planCurves("zzzzzzzzzzzzzzzzz"), InputError);
}

}  // namespace
}  // namespace probelab
