// SPDX-License-Identifier: GPL-3.0-or-later
// PNG files, tone mapping, error maps and labelled strips.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "base/error.h"
#include "base/files.h"
#include "base/rng.h"
#include "image/compose.h"
#include "image/png.h"
#include "image/tonemap.h"

namespace probelab {
namespace {
namespace fs = std::filesystem;
using Color = Vec3<uint8_t>;

Color pixelOf(const ByteImage& image, int x, int y) {
  const uint8_t* c = image.rgb.data() + 3 * (y * image.width + x);
  return {c[0], c[1], c[2]};
}

Image greyImage(std::vector<float> values) {
  return imageFromValues(static_cast<int>(values.size()), 1, values);
}

TEST(Png, DecodesToWhatWasWritten) {
  const fs::path path =
      fs::path(::testing::TempDir()) / ("png_" + std::to_string(getpid()) + ".png");
  ByteImage image = makeByteImage(37, 11, Color(0, 0, 0));
  Rng rng(1, RngStream::test);
  for (uint8_t& v : image.rgb) v = uint8_t(rng.nextBelow(256));
  writePng(path, image);
  const ByteImage read = readPng(path);
  EXPECT_EQ(read.width, 37);
  EXPECT_EQ(read.height, 11);
  EXPECT_EQ(read.rgb, image.rgb);
  const std::string bytes = readTextFile(path);
  // The last 12 bytes are the end chunk, after all pixels.
  for (size_t size = 0; size < bytes.size() - 12; size += 7) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes.substr(0, size);
    EXPECT_THROW(readPng(path), InputError) << size;
  }
  std::string huge = bytes;
  huge.replace(16, 8, std::string("\x7f\xff\xff\xff\x7f\xff\xff\xff", 8));
  std::ofstream(path, std::ios::binary | std::ios::trunc) << huge;
  EXPECT_THROW(readPng(path), InputError);
  fs::remove(path);
  EXPECT_THROW(readPng(path), InputError);
}

TEST(ToneMap, IsTheSrgbTransferFunction) {
  // IEC 61966-2-1: 0.5 encodes to 0.7354, 0.002 to 12.92 * 0.002.
  EXPECT_NEAR(linearToSrgb(0.5f), 0.735357f, 1e-5);
  EXPECT_NEAR(linearToSrgb(0.002f), 0.02584f, 1e-6);
  EXPECT_EQ(linearToSrgbByte(0.0f), 0);
  EXPECT_EQ(linearToSrgbByte(1.0f), 255);
  EXPECT_EQ(linearToSrgbByte(-3.0f), 0);
  EXPECT_EQ(linearToSrgbByte(1e30f), 255);
}

TEST(ToneMap, ExposesInStops) {
  const Image image = greyImage({0.125f, 0.5f, 1.0f});
  const ByteImage plain = toneMap(image), two_stops = toneMap(image, {2.0f, ToneCurve::clip});
  EXPECT_EQ(pixelOf(two_stops, 0, 0), pixelOf(plain, 1, 0));
  EXPECT_EQ(pixelOf(two_stops, 1, 0), Color(255, 255, 255));
}

TEST(ToneMap, FilmicCurveRisesAndKeepsHighlightsApart) {
  const ByteImage p = toneMap(greyImage({0, 0.1f, 0.5f, 1, 2, 4, 1e30f}), {0, ToneCurve::filmic});
  for (int x = 1; x < 7; ++x) EXPECT_GT(pixelOf(p, x, 0).x, pixelOf(p, x - 1, 0).x);
  // The fit at 1 (v = 0.6): 0.9216 / 1.3688 = 0.6733, in sRGB 0.8398.
  EXPECT_NEAR(pixelOf(p, 3, 0).x, 255 * 0.8398, 1);
}

TEST(ToneMap, RefusesPixelsThatAreNotFinite) {
  EXPECT_THROW(toneMap(greyImage({0, NAN})), NumericalError);
  EXPECT_THROW(suggestedExposure(greyImage({INFINITY})), NumericalError);
  EXPECT_THROW(falseColor(greyImage({NAN}), 0, 1), NumericalError);
  EXPECT_THROW(signedErrorMap(greyImage({NAN}), greyImage({0}), 1), NumericalError);
}

TEST(ToneMap, SuggestsAnExposureForWhatIsLit) {
  EXPECT_NEAR(suggestedExposure(greyImage({0, 0, 0, 0.2f})), 2.0f, 1e-5);  // 0.2 * 4 = 0.8
  EXPECT_EQ(suggestedExposure(greyImage({0, 0})), 0);
}

TEST(SignedError, IsBlueBelowWhiteAtAndRedAboveZero) {
  const ByteImage map = signedErrorMap(greyImage({0, 1, 2, 9}), greyImage({1, 1, 1, 1}), 1.0f);
  EXPECT_GT(pixelOf(map, 0, 0).z, pixelOf(map, 0, 0).x);
  EXPECT_EQ(pixelOf(map, 1, 0), Color(255, 255, 255));
  EXPECT_GT(pixelOf(map, 2, 0).x, pixelOf(map, 2, 0).z);
  EXPECT_EQ(pixelOf(map, 3, 0), pixelOf(map, 2, 0));  // full colour beyond the scale
  EXPECT_THROW(signedErrorMap(greyImage({1}), greyImage({1, 2}), 1), InputError);
}

TEST(SignedError, ScaleIsNotSetBySinglePixels) {
  std::vector<float> estimate(1000, 0.25f), reference(1000, 0.0f);
  estimate[3] = 1000;
  EXPECT_NEAR(suggestedErrorScale(greyImage(estimate), greyImage(reference)), 0.25f, 1e-6);
  EXPECT_EQ(suggestedErrorScale(greyImage(reference), greyImage(reference)), 0);
  reference[3] = 1;  // the only difference still gives a usable scale
  EXPECT_NEAR(suggestedErrorScale(greyImage(std::vector<float>(1000)), greyImage(reference)), 1,
              1e-6);
}

TEST(FalseColor, GrowsBrighterFromLowToHigh) {
  float last = -1;
  for (int i = 0; i <= 16; ++i) {
    const float brightness = luminance(Vec3f(falseColorOf(float(i) / 16)));
    EXPECT_GT(brightness, last);
    last = brightness;
  }
  EXPECT_EQ(pixelOf(falseColor(greyImage({-5, 2, 99}), 0, 2), 0, 0), falseColorOf(0));
}

TEST(Text, EveryGlyphIsDifferentAndInsideItsBox) {
  std::set<std::string> seen;
  for (char c = ' '; c <= '~'; ++c) {
    const std::string text(1, c);
    const TextSize size = measureText(text, 1);
    ByteImage image = makeByteImage(size.width + 4, size.height + 4, Color(255, 255, 255));
    drawText(image, 2, 2, text, 1, Color(0, 0, 0));
    EXPECT_TRUE(seen.emplace(image.rgb.begin(), image.rgb.end()).second) << c;
    for (int x = 0; x < image.width; ++x) {
      EXPECT_EQ(pixelOf(image, x, 1), Color(255, 255, 255)) << c;
      EXPECT_EQ(pixelOf(image, x, image.height - 2), Color(255, 255, 255)) << c;
    }
  }
}

TEST(Text, IsCutAtThePicturesEdges) {
  ByteImage image = makeByteImage(6, 6, Color(255, 255, 255));
  drawText(image, -9, -5, "W\xc3\xbcrfel", 3, Color(0, 0, 0));
  EXPECT_EQ(image.rgb.size(), size_t{108});
  EXPECT_EQ(measureText("", 3).width, 0);
  EXPECT_EQ(measureText("ab", 2).width, 22);
}

TEST(Strip, HoldsEveryPanelUnchanged) {
  std::vector<Panel> panels;
  for (int i = 0; i < 3; ++i)
    panels.push_back({"panel with a label far too long for it",
                      makeByteImage(60, 40, Color(uint8_t(50 * i), 9, 99)),
                      {}});
  panels[2].legend = signedErrorLegend(0.25f, "lux");
  const ByteImage strip =
      composePanels(panels, {.margin = 7, .text_scale = 2, .columns = 0, .caption = "caption"});
  EXPECT_EQ(strip.width, 3 * 67 + 7);
  for (int i = 0; i < 3; ++i) {
    int count = 0;
    for (int y = 0; y < strip.height; ++y)
      for (int x = 0; x < strip.width; ++x)
        count += pixelOf(strip, x, y) == Color(uint8_t(50 * i), 9, 99);
    EXPECT_EQ(count, 60 * 40) << i;
  }
  EXPECT_GT(composePanels(panels, {.columns = 1}).height, strip.height);
  EXPECT_THROW(composePanels({}, {}), InputError);
}

TEST(Strip, LegendShowsTheColoursOfTheMap) {
  const Panel panel{"e", makeByteImage(101, 30, Color(0, 0, 0)), signedErrorLegend(2)};
  const ByteImage strip = composePanels(std::span(&panel, 1), {.margin = 5, .text_scale = 2});
  bool found = false;
  for (int y = 0; y < strip.height; ++y)
    found |= pixelOf(strip, 5 + 25, y) == signedErrorColor(-0.5f) &&
             pixelOf(strip, 5 + 75, y) == signedErrorColor(0.5f);
  EXPECT_TRUE(found);
}

}  // namespace
}  // namespace probelab
