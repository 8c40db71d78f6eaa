// SPDX-License-Identifier: Apache-2.0
#include "image/tonemap.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "base/timer.h"

namespace probelab {
namespace {

constexpr float kSuggestedBrightness = 0.8f;

void requireFinite(std::span<const Vec3f> pixels, int width) {
  for (std::size_t i = 0; i < pixels.size(); ++i)
    if (!isFinite(pixels[i]))
      throw NumericalError(fmt::format("image: pixel ({}, {}) is not finite",
                                       i % static_cast<std::size_t>(width),
                                       i / static_cast<std::size_t>(width)));
}

std::vector<Vec3f> finitePixelsOf(const Image& image) {
  std::vector<Vec3f> pixels = pixelsOf(image);
  requireFinite(pixels, image.width);
  return pixels;
}

float filmicCurve(float x) {
  const float v = 0.6f * x;
  return v * (2.51f * v + 0.03f) / (v * (2.43f * v + 0.59f) + 0.14f);
}

uint8_t toByte(float unit) {
  return static_cast<uint8_t>(std::lround(255.0f * std::clamp(unit, 0.0f, 1.0f)));
}

template <class PixelColor>
ByteImage makePicture(int width, int height, const PixelColor& colorOf) {
  ByteImage picture{width, height, {}};
  const std::size_t count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  picture.rgb.reserve(3 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3<uint8_t> color = colorOf(i);
    picture.rgb.insert(picture.rgb.end(), {color.x, color.y, color.z});
  }
  return picture;
}

std::vector<float> luminanceDifference(const Image& estimate, const Image& reference) {
  if (estimate.width != reference.width || estimate.height != reference.height)
    throwInput("image: sizes differ: {} x {} against {} x {}", estimate.width, estimate.height,
               reference.width, reference.height);
  const std::vector<Vec3f> e = finitePixelsOf(estimate), r = finitePixelsOf(reference);
  std::vector<float> difference(e.size());
  for (std::size_t i = 0; i < e.size(); ++i) difference[i] = luminance(e[i]) - luminance(r[i]);
  return difference;
}

// t in [0, 1] along equally spaced colours, in sRGB values.
template <std::size_t N>
Vec3<uint8_t> interpolate(const std::array<Vec3f, N>& colors, float t) {
  const float position = std::clamp(t, 0.0f, 1.0f) * float(N - 1);
  const std::size_t below = std::min(static_cast<std::size_t>(position), N - 2);
  const float f = position - float(below);
  const Vec3f c = (colors[below] * (1 - f) + colors[below + 1] * f) / 255.0f;
  return {toByte(c.x), toByte(c.y), toByte(c.z)};
}

}  // namespace

float linearToSrgb(float linear) {
  const float v = std::clamp(linear, 0.0f, 1.0f);
  return v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1.0f / 2.4f) - 0.055f;
}

uint8_t linearToSrgbByte(float linear) { return toByte(linearToSrgb(linear)); }

ByteImage toneMap(const Image& image, const ToneMapping& mapping) {
  const std::vector<Vec3f> pixels = finitePixelsOf(image);
  const float gain = std::exp2(mapping.exposure_stops);
  const auto map = [&](float v) {
    // Far above white either curve has saturated; the bound keeps its squares finite.
    const float exposed = std::clamp(gain * v, 0.0f, 1e6f);
    return linearToSrgbByte(mapping.curve == ToneCurve::filmic ? filmicCurve(exposed) : exposed);
  };
  return makePicture(image.width, image.height, [&](std::size_t i) {
    return Vec3<uint8_t>(map(pixels[i].x), map(pixels[i].y), map(pixels[i].z));
  });
}

float suggestedExposure(const Image& image) {
  std::vector<double> lit;
  for (const Vec3f& p : finitePixelsOf(image))
    if (luminance(p) > 0) lit.push_back(luminance(p));
  if (lit.empty()) return 0;
  return float(std::log2(kSuggestedBrightness / percentile(std::move(lit), 0.95)));
}

Vec3<uint8_t> signedErrorColor(float t) {
  // The ends are those of ColorBrewer's RdBu, which stay apart for colour-blind readers.
  static constexpr std::array<Vec3f, 5> kColors = {Vec3f(5, 48, 97), Vec3f(67, 147, 195),
                                                   Vec3f(255, 255, 255), Vec3f(214, 96, 77),
                                                   Vec3f(103, 0, 31)};
  return interpolate(kColors, 0.5f * t + 0.5f);
}

Vec3<uint8_t> falseColorOf(float t) {
  // Nine points of viridis (van der Walt and Smith, CC0).
  static constexpr std::array<Vec3f, 9> kColors = {
      Vec3f(68, 1, 84),    Vec3f(71, 44, 122),  Vec3f(59, 81, 139),
      Vec3f(44, 113, 142), Vec3f(33, 144, 141), Vec3f(39, 173, 129),
      Vec3f(92, 200, 99),  Vec3f(170, 220, 50), Vec3f(253, 231, 37)};
  return interpolate(kColors, t);
}

ByteImage signedErrorMap(const Image& estimate, const Image& reference, float scale) {
  PROBELAB_CHECK(scale > 0);
  const std::vector<float> difference = luminanceDifference(estimate, reference);
  return makePicture(estimate.width, estimate.height,
                     [&](std::size_t i) { return signedErrorColor(difference[i] / scale); });
}

float suggestedErrorScale(const Image& estimate, const Image& reference) {
  std::vector<double> magnitudes;
  for (const float d : luminanceDifference(estimate, reference)) magnitudes.push_back(std::abs(d));
  const double largest = *std::max_element(magnitudes.begin(), magnitudes.end());
  const double scale = percentile(std::move(magnitudes), 0.99);
  return float(scale > 0 ? scale : largest);
}

ByteImage falseColor(const Image& image, float low, float high) {
  PROBELAB_CHECK(low < high);
  const std::vector<Vec3f> pixels = finitePixelsOf(image);
  return makePicture(image.width, image.height, [&](std::size_t i) {
    return falseColorOf((luminance(pixels[i]) - low) / (high - low));
  });
}

}  // namespace probelab
