// SPDX-License-Identifier: Apache-2.0
// FLIP, the difference a viewer sees when flipping between two images: 0 none, 1 the largest.
// LDR: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, "FLIP: A Difference
// Evaluator for Alternating Images", HPG 2020. HDR: Andersson, Nilsson, Shirley, Akenine-Möller,
// "Visualizing Errors in Rendered High Dynamic Range Images", Eurographics Short Papers 2021.
// Throws NumericalError naming the pixel where one is not finite.
#pragma once

#include <span>
#include <vector>

#include "base/vec.h"

namespace probelab {

// The papers' viewing conditions: 0.7 m from a display 0.7 m and 3840 pixels wide.
inline constexpr double kFlipPixelsPerDegree = 67.020643276582255;

struct FlipResult {
  double mean = 0;
  std::vector<float> map;  // [y][x], in [0, 1]
};

// Images of width * height pixels [y][x] in linear Rec.709, not sRGB-encoded; clamped to [0, 1].
FlipResult ldrFlip(std::span<const Vec3f> reference, std::span<const Vec3f> test, int width,
                   int height, double pixels_per_degree = kFlipPixelsPerDegree);

// Exposures of HDR-FLIP: `count` values from `start` to `stop`, in stops.
struct FlipExposureRange {
  double start = 0, stop = 0;
  int count = 2;
};
// With the paper's count, max(2, ceil(stop - start)).
FlipExposureRange flipExposures(double start, double stop);
// The paper's automatic range, from the reference's largest and median luminance. Throws InputError
// when half of the reference or more is black, where that range does not exist: give one then.
FlipExposureRange automaticFlipExposures(std::span<const Vec3f> reference);

// The largest LDR-FLIP per pixel over the exposures, tone mapped by the paper's ACES curve.
// Negative values count as 0.
FlipResult hdrFlip(std::span<const Vec3f> reference, std::span<const Vec3f> test, int width,
                   int height, const FlipExposureRange& exposures,
                   double pixels_per_degree = kFlipPixelsPerDegree);

}  // namespace probelab
