// SPDX-License-Identifier: GPL-3.0-or-later
// FLIP against an independent implementation (scripts/crosscheck_flip.py holds the same formulas
// and made the expected values), and what the papers say must hold.
#include "metrics/flip.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace probelab {
namespace {

// The other implementation is in fp32. Where colours or features are equal it sees a difference of
// eps = 2^-24 times about 4 roundings: sqrt(4 eps) = 5e-4 in the feature term, which moves
// c^(1 - f) by at most |c ln c| 5e-4 < 2e-4.
constexpr double kTolerance = 2e-4;

using Formula = std::function<double(int x, int y, int c)>;

std::vector<Vec3f> makePixels(int width, int height, const Formula& value) {
  std::vector<Vec3f> pixels;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      pixels.emplace_back(float(value(x, y, 0)), float(value(x, y, 1)), float(value(x, y, 2)));
  return pixels;
}

double noise(int x, int y, int c) {
  uint32_t h = uint32_t(x) * 73856093u ^ uint32_t(y) * 19349663u ^ uint32_t(c) * 83492791u;
  h = (h ^ (h >> 13)) * 1274126177u;
  return ((h ^ (h >> 16)) & 0xffff) / 65536.0;
}

Formula gradient(int w, int h) {
  return [=](int x, int y, int c) { return c == 0 ? x / (w - 1.0) : c == 1 ? y / (h - 1.0) : 0.5; };
}

double spot(int x, int y, int c) {
  const double r2 = (x - 20) * (x - 20) + (y - 15) * (y - 15);
  return 0.05 * (c + 1) + 1000 / ((1 + r2) * (1 + r2));
}

nlohmann::json expectedOf(const std::string& name) {
  std::ifstream in(PROBELAB_SOURCE_DIR "/tests/unit/metrics/flip_expected.json");
  return nlohmann::json::parse(in).at(name);
}

void expectResult(const FlipResult& result, const std::string& name, int width, int height) {
  const nlohmann::json expected = expectedOf(name);
  EXPECT_NEAR(result.mean, expected.at("mean"), kTolerance) << name;
  EXPECT_NEAR(result.map[size_t(height / 2 * width + width / 2)], expected.at("center"), kTolerance)
      << name;
  EXPECT_NEAR(*std::max_element(result.map.begin(), result.map.end()), expected.at("max"),
              kTolerance)
      << name;
}

void expectLdr(const std::string& name, const Formula& reference, const Formula& test,
               int width = 61, int height = 43, double ppd = kFlipPixelsPerDegree) {
  expectResult(ldrFlip(makePixels(width, height, reference), makePixels(width, height, test), width,
                       height, ppd),
               name, width, height);
}

TEST(LdrFlip, AgreesWithAnIndependentImplementation) {
  const Formula g = gradient(61, 43);
  expectLdr("ldr_offset", g, [&](int x, int y, int c) { return 0.9 * g(x, y, c); });
  expectLdr(
      "ldr_checker", [](int x, int y, int) { return (x / 3 + y / 3) % 2; },
      [](int, int, int) { return 0.5; });
  expectLdr("ldr_noise", noise, [](int x, int y, int c) { return noise(x + 7, y, c); });
  expectLdr(
      "ldr_green_blue", [](int, int, int c) { return c == 1; },
      [](int, int, int c) { return c == 2; });
  expectLdr("ldr_smaller_than_filter", gradient(7, 5), noise, 7, 5);
  expectLdr(
      "ldr_other_distance", g, [&](int x, int y, int c) { return std::pow(g(x, y, c), 2); }, 61, 43,
      30.0);
}

TEST(HdrFlip, AgreesWithAnIndependentImplementation) {
  const int w = 61, h = 43;
  const std::vector<Vec3f> s = makePixels(w, h, spot);
  expectResult(hdrFlip(s, makePixels(w, h, [](int x, int y, int c) { return 0.8 * spot(x, y, c); }),
                       w, h, flipExposures(-3, 4)),
               "hdr_spot", w, h);
  expectResult(
      hdrFlip(s,
              makePixels(
                  w, h, [](int x, int y, int c) { return spot(x, y, c) * (0.5 + noise(x, y, c)); }),
              w, h, automaticFlipExposures(s)),
      "hdr_automatic", w, h);
  expectResult(hdrFlip(makePixels(w, h, [](int x, int, int) { return x < 15 ? 2.0 : 0.0; }),
                       makePixels(w, h, [](int x, int, int) { return x < 15 ? 2.0 : 0.02; }), w, h,
                       flipExposures(-3, 4)),
               "hdr_leak_in_the_dark", w, h);
}

TEST(HdrFlip, AutomaticExposuresAreThePapers) {
  const nlohmann::json expected = expectedOf("hdr_automatic");
  const FlipExposureRange range = automaticFlipExposures(makePixels(61, 43, spot));
  // fp32 log2 of numbers near 2^10: 2^-24 * 10.
  EXPECT_NEAR(range.start, expected.at("start"), 2e-6);
  EXPECT_NEAR(range.stop, expected.at("stop"), 2e-6);
  EXPECT_EQ(range.count, expected.at("count"));
}

TEST(HdrFlip, RefusesAutomaticExposuresOfAMostlyBlackReference) {
  const auto pixels = makePixels(10, 10, [](int x, int, int) { return x < 3 ? 1.0 : 0.0; });
  EXPECT_THROW(automaticFlipExposures(pixels), InputError);
}

TEST(HdrFlip, CountsExposuresAsThePaper) {
  EXPECT_EQ(flipExposures(-3, 4).count, 7);
  EXPECT_EQ(flipExposures(0, 0).count, 2);
  EXPECT_EQ(flipExposures(0, 2.5).count, 3);
  EXPECT_THROW(flipExposures(1, 0), InputError);
  EXPECT_THROW(flipExposures(NAN, 0), InputError);
}

TEST(Flip, OfEqualImagesIsExactlyZero) {
  const auto pixels = makePixels(20, 9, noise);
  EXPECT_EQ(ldrFlip(pixels, pixels, 20, 9).mean, 0.0);
  EXPECT_EQ(hdrFlip(pixels, pixels, 20, 9, flipExposures(-2, 2)).mean, 0.0);
}

TEST(Flip, RefusesPixelsThatAreNotFinite) {
  auto pixels = makePixels(4, 4, noise);
  const auto good = pixels;
  pixels[5].y = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(ldrFlip(good, pixels, 4, 4), NumericalError);
  EXPECT_THROW(hdrFlip(pixels, good, 4, 4, flipExposures(0, 1)), NumericalError);
  EXPECT_THROW(automaticFlipExposures(pixels), NumericalError);
}

}  // namespace
}  // namespace probelab
