// SPDX-License-Identifier: GPL-3.0-or-later
// Dithered rounding: the stored value is one of the two neighbours, and its mean is the value.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "base/rng.h"
#include "shared/atlas_format.h"

namespace probelab {
namespace {

struct Format {
  const char* name;
  std::function<Vec3f(const Vec3f&, uint)> store;  // pack and unpack
  float smallest, largest;                         // of the values that are tested
};

const Format kFormats[] = {
    {"Rgba16f",
     [](const Vec3f& v, uint r) {
       const uint pair = packHalfPair(v.x, v.y, r);
       const uint z = packHalfFloat(v.z, r == kRoundToNearest ? r : ditherHash(~r));
       return Vec3f(unpackHalfFloat(pair & 0xffffu), unpackHalfFloat(pair >> 16),
                    unpackHalfFloat(z));
     },
     1e-7f, 6e4f},
    {"R11g11b10f", [](const Vec3f& v, uint r) { return unpackR11G11B10(packR11G11B10(v, r)); },
     1e-7f, 6e4f},
    {"Rgb10a2", [](const Vec3f& v, uint r) { return unpackRgb10A2(packRgb10A2(v, r)); }, 1e-7f,
     1.0f},
};

class Rounding : public ::testing::TestWithParam<Format> {
 protected:
  // Logarithmic over the range, subnormals of the small floats included.
  Vec3f randomValue(Rng& rng) const {
    const auto one = [&] {
      const double low = std::log(GetParam().smallest), high = std::log(GetParam().largest);
      return static_cast<float>(std::exp(low + (high - low) * rng.nextDouble()));
    };
    return {one(), one(), one()};
  }
};

// E[unpack(pack(x, random))] = x: the mean over k roundings of a value between the neighbours a < b
// scatters by at most (b - a) / 2 / sqrt(k).
TEST_P(Rounding, DitheringIsUnbiased) {
  Rng rng(1, RngStream::test);
  constexpr int kRoundings = 4000;
  for (int i = 0; i < 60; ++i) {
    const Vec3f value = randomValue(rng);
    double mean[3] = {};
    float low[3], high[3];
    std::fill(low, low + 3, std::numeric_limits<float>::infinity());
    std::fill(high, high + 3, -1.0f);
    for (int k = 0; k < kRoundings; ++k) {
      const auto random = ditherHash(static_cast<uint>(rng.nextBits()));
      const Vec3f stored = GetParam().store(value, random);
      for (std::size_t c = 0; c < 3; ++c) {
        mean[c] += static_cast<double>(stored[c]) / kRoundings;
        low[c] = std::min(low[c], stored[c]);
        high[c] = std::max(high[c], stored[c]);
      }
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const double x = static_cast<double>(value[c]), step = static_cast<double>(high[c] - low[c]);
      EXPECT_LE(low[c], value[c]);
      // A value within 1/1,000 of its lower neighbour may never have been rounded up.
      EXPECT_NEAR(mean[c], x,
                  4 * step / 2 / std::sqrt(kRoundings) + 1e-6 * x +
                      (step == 0 ? std::abs(x - static_cast<double>(low[c])) : 0))
          << "value " << x << " channel " << c;
    }
  }
}

// The value rounded down and up are neighbours of the nearest: no dither moves by a whole step.
TEST_P(Rounding, DitheringTakesOneOfTheTwoNeighbours) {
  Rng rng(2, RngStream::test);
  for (int i = 0; i < 20000; ++i) {
    const Vec3f value = randomValue(rng);
    const auto random = static_cast<uint>(rng.nextBits()) & 0xfffffffeu;
    const Vec3f stored = GetParam().store(value, random);
    const Vec3f down = GetParam().store(value, 0), up = GetParam().store(value, 0xfffffffeu);
    for (std::size_t c = 0; c < 3; ++c) {
      // Channels take hashes of `random`, so their bounds come from the red one.
      if (c > 0) continue;
      EXPECT_LE(down[c], value[c] * 1.000001f);
      EXPECT_GE(up[c], value[c] * 0.999999f);
      EXPECT_TRUE(stored[c] == down[c] || stored[c] == up[c]) << value[c];
    }
  }
}

TEST_P(Rounding, ValuesOfTheFormatStayForEveryRandomNumber) {
  Rng rng(3, RngStream::test);
  for (int i = 0; i < 3000; ++i) {
    const Vec3f value = GetParam().store(randomValue(rng), kRoundToNearest);
    // Ten bits are not exact in fp32: 1023 * (k / 1023) may lie an ulp beside k.
    if (std::string(GetParam().name) == "Rgb10a2") continue;
    EXPECT_EQ(GetParam().store(value, ditherHash(static_cast<uint>(i))), value);
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, Rounding, ::testing::ValuesIn(kFormats),
                         [](const auto& info) { return std::string(info.param.name); });

// The three channels are rounded independently: a grey value does not drift in hue together.
TEST(Dither, ChannelsAreIndependent) {
  int both = 0, red = 0, green = 0;
  constexpr int kSamples = 20000;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3f stored =
        unpackR11G11B10(packR11G11B10(Vec3f(1 + 1 / 128.0f), ditherHash(static_cast<uint>(i))));
    const bool r = stored.x > 1, g = stored.y > 1;
    red += r ? 1 : 0, green += g ? 1 : 0, both += r && g ? 1 : 0;
  }
  // Half of each, a quarter of both; 4 standard errors.
  EXPECT_NEAR(red, kSamples / 2, 4 * 0.5 * std::sqrt(kSamples));
  EXPECT_NEAR(green, kSamples / 2, 4 * 0.5 * std::sqrt(kSamples));
  EXPECT_NEAR(both, kSamples / 4, 4 * std::sqrt(3.0 / 16 * kSamples));
}

}  // namespace
}  // namespace probelab
