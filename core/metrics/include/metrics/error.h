// SPDX-License-Identifier: Apache-2.0
// Error of irradiance estimates at receivers against a reference in two independent halves A and B,
// with leaks and the reference's own noise. (Ê-A)(Ê-B) is an unbiased estimate of (Ê-truth)², so
// `nrmse` holds no reference noise. Double precision, luminance of linear Rec.709.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "base/vec.h"

namespace probelab {

// Values of ReceiverSamples::kind.
inline constexpr int kSurfaceReceiver = 0;
inline constexpr int kVolumeReceiver = 1;

// Parallel arrays, one element a receiver. Irradiance is linear RGB, positions are in metres.
struct ReceiverSamples {
  std::span<const Vec3f> estimate;
  std::span<const Vec3f> a, b;      // the reference's halves; R = (A + B) / 2
  std::span<const Vec3f> position;  // only for pooling the reference's variance
  std::span<const float> area;      // weights of any positive sum; renormalised to 1
  std::span<const int> region = {};  // may be empty: all in one region
  // kSurfaceReceiver, kVolumeReceiver; may be empty: no tables per kind
  std::span<const int> kind = {};
};

// R̄ = Σ a R; σ² is pooledVariance. A ratio is null where Σ a A B or R̄ is not positive (an unlit
// scene), and `max_abs` stands instead.
struct ErrorMetrics {
  std::optional<double> nrmse;        // sqrt(max(0, Σ a (Ê-A)(Ê-B) / Σ a A B))
  std::optional<double> bias;         // Σ a (Ê-R) / R̄
  std::optional<double> relmse;       // Σ a (Ê-R)² / (R² + (0.01 R̄)²)
  std::optional<double> smape;        // Σ a 2|Ê-R| / (|Ê| + |R| + 1e-3 R̄)
  std::optional<double> p95, p99;     // area-weighted percentiles of |Ê-R| / (|R| + 0.01 R̄)
  std::optional<double> light_leak;   // Σ a max(0, Ê-R-2σ) / R̄ over receivers with R < 0.1 R̄
  std::optional<double> shadow_leak;  // Σ a max(0, R-Ê-2σ) / R̄ over the other receivers
  std::optional<double> dark_leak;  // area-weighted mean of Ê / R̄ where R < 0.01 R̄; null if none
  std::optional<double> leak_area;  // share of area with |Ê-R| > 0.5 R + 0.05 R̄
  double max_abs = 0;               // largest |Ê|
  std::array<std::optional<double>, 3> nrmse_rgb, bias_rgb;  // the same per channel
};

// `surface` and `volume` are the same table over the receivers of that kind alone (weights and R̄
// over them, the same σ); null without such receivers.
// A noise floor has nrmse = sqrt(Σ a (A-B)²/4 / Σ a A B) and the other numbers with Ê := A, R := B.
struct ErrorReport {
  ErrorMetrics all, noise_floor;
  std::optional<ErrorMetrics> surface, surface_noise_floor;
  std::optional<ErrorMetrics> volume, volume_noise_floor;
  double mean_reference = 0;  // R̄ over all receivers, luminance
};

// Throws NumericalError naming array and index where an input is not finite, InputError when there
// are no receivers or the weights are negative or sum to 0.
ErrorReport computeErrors(const ReceiverSamples& samples);

// σ_i²: the mean of (A-B)²/4 in luminance over the 16 receivers of the same region and kind that
// are nearest to receiver i, itself included (all of them where there are fewer). Equal distances
// are taken in the order of the indices.
std::vector<double> pooledVariance(const ReceiverSamples& samples);

// The smallest value that at least the share q in (0, 1] of the weight does not exceed (the inverse
// of the weighted distribution function, without interpolation).
double weightedPercentile(std::span<const double> values, std::span<const double> weights,
                          double q);

// A number is resolved when it is above 4 times its noise floor; false where either is null.
bool isResolved(const std::optional<double>& value, const std::optional<double>& floor);

// The scalar metrics under the names that results use, in the order of the definitions above;
// `max_abs` last.
std::vector<std::pair<std::string_view, std::optional<double>>> namedMetrics(
    const ErrorMetrics& metrics);

}  // namespace probelab
