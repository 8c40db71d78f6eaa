// SPDX-License-Identifier: GPL-3.0-or-later
#include "tuning/tuned_keys.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"

namespace probelab {
namespace {

using Names = std::vector<std::string>;

const Names kQueryKeys = {"normal_bias",     "view_bias",       "facing_offset",
                          "trilinear_floor", "chebyshev_power", "visibility_floor",
                          "variance_bias",   "crush_threshold", "parallax"};

std::string refusal(const Names& names, const Params& params, bool lattice = true) {
  try {
    tunedKeys(names, params, lattice);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(TunedKeys, EveryPresetsValuesSurviveTheCoordinates) {
  for (const std::string& preset : {"rtxgi", "probelab", "gdc2019", "majercik2021"}) {
    const Params params = loadParams(preset);
    const auto keys = tunedKeys(kQueryKeys, params).inner;
    ASSERT_EQ(keys.size(), 9u);
    Params back = params;
    setCoordinates(keys, toCoordinates(keys, params), back);
    for (const TunedKey& key : keys) {
      EXPECT_LT(key.low, key.high) << key.name;
      EXPECT_NEAR(back.*key.value, params.*key.value, 1e-12) << preset << " " << key.name;
    }
    // A floor of 0 is 0, not small.
    if (params.visibility_floor == 0) EXPECT_EQ(back.visibility_floor, 0) << preset;
  }
}

TEST(TunedKeys, TheEndsAreReachedExactlyAndTheSlopeIsTheValuesOwn) {
  const Params params = loadParams("rtxgi");
  for (const TunedKey& key : tunedKeys(kQueryKeys, params).inner) {
    EXPECT_EQ(keyValue(key, 0), key.low) << key.name;
    EXPECT_EQ(keyValue(key, 1), key.high) << key.name;
    EXPECT_EQ(keyValue(key, 1e-9), key.low) << key.name;
    EXPECT_EQ(keyValue(key, 1 - 1e-9), key.high) << key.name;
    for (const double x : {0.05, 0.3, 0.9}) {
      const double h = 1e-5;
      const double slope = (keyValue(key, x + h) - keyValue(key, x - h)) / (2 * h);
      EXPECT_NEAR(keySlope(key, x) / slope, 1, 1e-6) << key.name;  // h^2 growth^2 / 6 < 1e-8
      EXPECT_NEAR(keyCoordinate(key, keyValue(key, x)), x, 1e-12) << key.name;
    }
  }
}

TEST(TunedKeys, ARangeGrowsToHoldTheStart) {
  Params params = loadParams("rtxgi");
  params.normal_bias = 1.5;
  const TunedKey key = tunedKeys(Names{"normal_bias"}, params).inner[0];
  EXPECT_EQ(key.high, 1.5);
  EXPECT_EQ(keyValue(key, keyCoordinate(key, 1.5)), 1.5);
}

TEST(TunedKeys, KeysWithoutEffectAreRefusedWithTheReason) {
  Params params = loadParams("rtxgi");
  EXPECT_EQ(refusal({"crush_threshold"}, params), "");
  params.crush = PL_CRUSH_NONE;
  EXPECT_NE(refusal({"crush_threshold"}, params).find("crush is none"), std::string::npos);
  EXPECT_NE(refusal({"trilinear_floor"}, params, false).find("not a lattice"), std::string::npos);
  EXPECT_NE(refusal({"facing_offset"}, loadParams("classic")).find("facing is none"),
            std::string::npos);
  EXPECT_NE(refusal({"distance_exponent"}, loadParams("classic")).find("visibility is false"),
            std::string::npos);
  EXPECT_NE(refusal({"hysteresis"}, params).find("cannot be tuned"), std::string::npos);
  EXPECT_NE(refusal({"average"}, params).find("cannot be tuned"), std::string::npos);
  EXPECT_NE(refusal({"normal_bias", "normal_bias"}, params).find("named twice"), std::string::npos);
  EXPECT_NE(refusal({"normal_bais"}, params).find("normal_bias"), std::string::npos);
}

TEST(TunedKeys, DefaultsAreThoseThatAct) {
  EXPECT_EQ(defaultKeys(loadParams("probelab")).size(), 6u);
  EXPECT_EQ(defaultKeys(loadParams("classic")), (Names{"normal_bias", "view_bias"}));
}

TEST(TunedKeys, KeysOfTheAtlasesAreForTheOuterSearch) {
  Params params = loadParams("rtxgi");
  const KeySplit split = tunedKeys(Names{"distance_exponent", "view_bias", "rays"}, params);
  ASSERT_EQ(split.inner.size(), 1u);
  ASSERT_EQ(split.outer.size(), 2u);
  setOuterKey(split.outer[0], 123.25, params);
  setOuterKey(split.outer[1], 63.6, params);
  EXPECT_EQ(params.distance_exponent, 123.25);
  EXPECT_EQ(params.rays, 64);
  EXPECT_EQ(params.name, "rtxgi");
  setOuterKey(split.outer[1], 1e9, params);
  EXPECT_EQ(params.rays, 1024);
}

}  // namespace
}  // namespace probelab
