// SPDX-License-Identifier: Apache-2.0
// From linear values to pictures: exposure and sRGB, signed error maps, false colour. Every
// function throws NumericalError naming the pixel where a value is not finite.
#pragma once

#include "image/image.h"

namespace probelab {

// clip: min(v, 1). filmic: the fit of ACES by Narkowicz (2015), (v (2.51 v + 0.03)) /
// (v (2.43 v + 0.59) + 0.14) with v scaled by 0.6, which keeps highlights apart.
enum class ToneCurve { clip, filmic };

struct ToneMapping {
  float exposure_stops = 0;  // v = 2^stops * pixel
  ToneCurve curve = ToneCurve::clip;
};

// The sRGB transfer function (IEC 61966-2-1) of a value, clamped to [0, 1].
float linearToSrgb(float linear);
uint8_t linearToSrgbByte(float linear);

// The picture of an image's colour (pixelsOf). Negative values are black.
ByteImage toneMap(const Image& image, const ToneMapping& mapping = {});

// Stops that bring the 95th percentile of the luminance of lit pixels (above 0) to 0.8; 0 for a
// black image.
float suggestedExposure(const Image& image);

// (estimate - reference) of luminance: blue is too dark, white is right, red is too bright; full
// colour at +-scale. The images have one size; scale is positive.
ByteImage signedErrorMap(const Image& estimate, const Image& reference, float scale);
// The largest |difference| but for the top percent: a scale that single pixels do not set. 0 where
// the images are equal.
float suggestedErrorScale(const Image& estimate, const Image& reference);
// The colour of difference / scale = t in [-1, 1].
Vec3<uint8_t> signedErrorColor(float t);

// One value a pixel (the luminance of a colour image): viridis from low to high, low < high.
ByteImage falseColor(const Image& image, float low, float high);
Vec3<uint8_t> falseColorOf(float t);  // t in [0, 1]

}  // namespace probelab
