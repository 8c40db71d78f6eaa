// SPDX-License-Identifier: Apache-2.0
// Error of an image against a reference image, in double on luminance of linear Rec.709. Pixels are
// weighted alike. Throws NumericalError naming the pixel before any metric where one is not finite.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "base/vec.h"

namespace probelab {

// R̄ is the mean of the reference. Null where R̄ (for nrmse: also the mean of A B) is not positive.
struct ImageMetrics {
  std::optional<double> nrmse;   // sqrt(max(0, mean (Ê-A)(Ê-B) / mean A B)); null without halves
  std::optional<double> rmse;    // sqrt(mean (Ê-R)²) / R̄; the reference's noise is in it
  std::optional<double> mae;     // mean |Ê-R| / R̄
  std::optional<double> bias;    // mean (Ê-R) / R̄
  std::optional<double> relmse;  // mean (Ê-R)² / (R² + (0.01 R̄)²)
  std::optional<double> smape;   // mean 2|Ê-R| / (|Ê| + |R| + 1e-3 R̄)
  double max_abs = 0;            // largest |Ê|
};

// Arrays of one size, [y][x], linear RGB.
ImageMetrics computeImageMetrics(std::span<const Vec3f> estimate, std::span<const Vec3f> reference);
// Against independent halves A and B; R = (A + B) / 2.
ImageMetrics computeImageMetrics(std::span<const Vec3f> estimate, std::span<const Vec3f> a,
                                 std::span<const Vec3f> b);

// Under the names that results use.
std::vector<std::pair<std::string_view, std::optional<double>>> namedMetrics(
    const ImageMetrics& metrics);

}  // namespace probelab
