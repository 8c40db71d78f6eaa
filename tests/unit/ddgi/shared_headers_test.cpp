// SPDX-License-Identifier: GPL-3.0-or-later
// Octahedral maps, storage formats and probe weights of the shared headers, in C++.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "base/rng.h"
#include "random_unit.h"
#include "shared/atlas_format.h"
#include "shared/query.h"

namespace probelab {
namespace {

using test::randomUnitDouble;

TEST(Octahedral, DecodeInvertsEncode) {
  Rng rng(1, RngStream::test);
  for (int i = 0; i < 20000; ++i) {
    const Vec3d d = randomUnitDouble(rng);
    EXPECT_LT(length(octDecode(octEncode(d)) - d), 1e-12);
    // In float: a few roundings at 2^-24 on each axis.
    const Vec3f f(d);
    EXPECT_LT(length(octDecode(octEncode(f)) - f), 1e-6f);
  }
  for (const Vec3d& axis : {Vec3d(1, 0, 0), Vec3d(0, -1, 0), Vec3d(0, 0, 1), Vec3d(0, 0, -1)})
    EXPECT_LT(length(octDecode(octEncode(axis)) - axis), 1e-12);
}

TEST(Octahedral, TapsStayWithinTheTileAndWeighToTheDirection) {
  Rng rng(2, RngStream::test);
  for (const int border : {0, 1})
    for (const int n : {1, 2, 4, 6, 14}) {
      const int texels = (n + 2 * border) * (n + 2 * border);
      for (int i = 0; i < 5000; ++i) {
        const OctTaps<double> taps = octTaps(randomUnitDouble(rng), n, border);
        for (const int t : {taps.texel_00, taps.texel_10, taps.texel_01, taps.texel_11}) {
          EXPECT_GE(t, 0);
          EXPECT_LT(t, texels);
        }
        for (const double f : {taps.fraction_x, taps.fraction_y}) {
          EXPECT_GE(f, 0);
          EXPECT_LE(f, 1);
        }
      }
      // A texel's own direction reads that texel alone.
      for (int i = 0; i < n * n; ++i) {
        const OctTaps<double> t = octTaps(texelDirection<double>(i % n, i / n, n), n, border);
        const int own = tileTexel(i % n, i / n, n, border);
        const double wx[2] = {1 - t.fraction_x, t.fraction_x};
        const double wy[2] = {1 - t.fraction_y, t.fraction_y};
        double weight = 0;
        if (t.texel_00 == own) weight += wx[0] * wy[0];
        if (t.texel_10 == own) weight += wx[1] * wy[0];
        if (t.texel_01 == own) weight += wx[0] * wy[1];
        if (t.texel_11 == own) weight += wx[1] * wy[1];
        EXPECT_NEAR(weight, 1, 1e-12) << n << " texel " << i;
      }
    }
}

// Without a border, a tap beyond the edge is the texel whose direction is nearest to where the map
// goes on: the direction half a texel outside equals that of the texel itself.
TEST(Octahedral, TilesWithoutBorderWrapToTheNeighbourOnTheSphere) {
  for (const int n : {2, 5, 12})
    for (int i = -1; i <= n; ++i)
      for (const Vec3i at : {Vec3i(i, -1, 0), Vec3i(i, n, 0), Vec3i(-1, i, 0), Vec3i(n, i, 0)}) {
        const int texel = tileTexel(at.x, at.y, n, 0);
        // Fold the map point by hand: over an edge x -> 2 - x with y -> -y.
        Vec2d p((at.x + 0.5) / n * 2 - 1, (at.y + 0.5) / n * 2 - 1);
        if (std::abs(p.x) > 1) p = {std::copysign(2, p.x) - p.x, -p.y};
        if (std::abs(p.y) > 1) p = {-p.x, std::copysign(2, p.y) - p.y};
        const Vec3d d = texelDirection<double>(texel % n, texel / n, n);
        EXPECT_NEAR(length(d - octDecode(p)), 0, 1e-12) << n << " at " << at.x << ", " << at.y;
      }
}

// All values of a small float by its definition.
std::vector<double> smallFloats(int mantissa_bits) {
  std::vector<double> values;
  for (int e = 0; e < 31; ++e)
    for (int m = 0; m < 1 << mantissa_bits; ++m) {
      const double fraction = static_cast<double>(m) / (1 << mantissa_bits);
      values.push_back(e == 0 ? std::ldexp(fraction, -14) : std::ldexp(1 + fraction, e - 15));
    }
  return values;
}

class SmallFloat : public ::testing::TestWithParam<uint> {};

TEST_P(SmallFloat, EveryValueSurvivesAndOthersGoToTheNearestEven) {
  const uint bits = GetParam();
  const std::vector<double> values = smallFloats(static_cast<int>(bits));
  for (uint i = 0; i < values.size(); ++i) {
    const auto value = static_cast<float>(values[i]);
    ASSERT_EQ(unpackSmallFloat(i, bits), value);
    ASSERT_EQ(packSmallFloat(value, bits, kRoundToNearest), i);
    if (i + 1 == values.size()) break;
    const double middle = 0.5 * (values[i] + values[i + 1]);
    const auto exact_middle = static_cast<float>(middle);
    ASSERT_EQ(packSmallFloat(exact_middle, bits, kRoundToNearest), i % 2 == 0 ? i : i + 1);
    ASSERT_EQ(packSmallFloat(std::nextafter(exact_middle, 0.0f), bits, kRoundToNearest), i);
    ASSERT_EQ(packSmallFloat(std::nextafter(exact_middle, 1e9f), bits, kRoundToNearest), i + 1);
  }
  const auto largest = static_cast<uint>(values.size() - 1);
  EXPECT_EQ(packSmallFloat(1e9f, bits, kRoundToNearest), largest);
  EXPECT_EQ(packSmallFloat(std::numeric_limits<float>::infinity(), bits, kRoundToNearest), largest);
}

INSTANTIATE_TEST_SUITE_P(MantissaBits, SmallFloat, ::testing::Values(10u, 6u, 5u));

TEST(AtlasFormat, HalvesKeepTheirSign) {
  EXPECT_EQ(unpackHalfFloat(packHalfFloat(-1.5f, kRoundToNearest)), -1.5f);
  EXPECT_EQ(unpackHalfFloat(packHalfFloat(-70000.0f, kRoundToNearest)), -65504.0f);
}

TEST(AtlasFormat, UnsignedFormatsCutNegativeValues) {
  EXPECT_EQ(unpackR11G11B10(packR11G11B10(Vec3f(-1, 2, -0.0f), kRoundToNearest)), Vec3f(0, 2, 0));
  EXPECT_EQ(unpackRgb10A2(packRgb10A2(Vec3f(-1, 2, 0), kRoundToNearest)), Vec3f(0, 1, 0));
}

TEST(AtlasFormat, TenBitsRoundToTheNearestStep) {
  for (uint i = 0; i < 1024; ++i) {
    const float value = static_cast<float>(i) / 1023;
    EXPECT_EQ(packUnorm10(value, kRoundToNearest), i);
    EXPECT_EQ(packUnorm10(value + 0.4f / 1023, kRoundToNearest), i);
  }
}

QueryParams<double> plainParams() {
  QueryParams<double> params{};
  params.chebyshev_power = 1;
  params.crush_threshold = 0.2;
  params.decode_exponent = 1;
  return params;
}

// A texel that sees share `far` of its lobe at 5 and the rest at 2: at the far depth the one-sided
// Chebyshev bound is that share exactly.
TEST(ProbeWeight, ChebyshevIsExactForTwoDepths) {
  QueryParams<double> params = plainParams();
  const double far = 0.7;
  const Vec2d moments((1 - far) * 2 + far * 5, (1 - far) * 4 + far * 25);
  EXPECT_NEAR(visibilityWeight(params, moments, 5.0), far, 1e-12);
  params.chebyshev_power = 3;
  EXPECT_NEAR(visibilityWeight(params, moments, 5.0), far * far * far, 1e-12);
  EXPECT_EQ(visibilityWeight(params, moments, 4.0), 1.0);  // nearer than the mean
}

TEST(ProbeWeight, NoVarianceAndNoFloorBlocksEntirely) {
  QueryParams<double> params = plainParams();
  EXPECT_EQ(visibilityWeight(params, Vec2d(1, 1), 1.001), 0.0);
  EXPECT_EQ(visibilityWeight(params, Vec2d(1, 1), 1.0), 1.0);
  params.visibility_floor = 0.05;
  EXPECT_EQ(visibilityWeight(params, Vec2d(1, 1), 1.001), 0.05);
}

// [RTXGI]: floor 0.05, wrap 1.2, crushed by 0.2: 0.06 becomes 0.06^3 / 0.04 = 0.0054.
TEST(ProbeWeight, CrushedWeightOfAnOccludedProbe) {
  QueryParams<double> params = plainParams();
  params.facing_offset = 0.2;
  const QueryModes modes{PL_FACING_WRAP,  PL_TRILINEAR_AXIS_MAX, 1, PL_CRUSH_BEFORE_TRILINEAR,
                         PL_AVERAGE_SQRT, PL_FALLBACK_NONE,      0, 0, 0, 0};
  EXPECT_NEAR(probeWeight(params, modes, 1.0, 1.0, 0.05), 0.06 * 0.06 * 0.06 / 0.04, 1e-12);
  EXPECT_NEAR(probeWeight(params, modes, 0.5, 1.0, 1.0), 0.6, 1e-12);
}

// A ceiling 2 m above a point and above a probe 1 m aside of it: the probe sees what is straight
// above the point at atan(1 / 2). Seen from the point's own line, or with parallax 0, it reads along
// the normal.
TEST(Parallax, ProbesReadTowardsWhatThePointFaces) {
  QueryParams<double> params = plainParams();
  const Vec3d up(0, 1, 0);
  params.parallax = 1;
  const Vec3d d = parallaxDirection(params, up, Vec3d(-1, -0.5, 0), 2.0);
  EXPECT_NEAR(d.x / d.y, -1 / std::sqrt(5.0), 1e-12);  // 1 / sqrt(2^2 + 1^2): never above 45 degrees
  EXPECT_EQ(d.z, 0);
  EXPECT_EQ(parallaxDirection(params, up, Vec3d(0, -3, 0), 2.0), up);
  EXPECT_EQ(parallaxDirection(params, up, Vec3d(0, 0, 0), 0.0), up);
  params.parallax = 0;
  EXPECT_EQ(parallaxDirection(params, up, Vec3d(-1, -0.5, 0), 2.0), up);
}

TEST(ProbeWeight, CrushIsContinuousAtItsThreshold) {
  const QueryParams<double> params = plainParams();
  EXPECT_NEAR(crushWeight(params, 0.2 - 1e-12), crushWeight(params, 0.2), 1e-10);
}

}  // namespace
}  // namespace probelab
