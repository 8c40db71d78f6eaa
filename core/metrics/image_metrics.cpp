// SPDX-License-Identifier: Apache-2.0
#include "metrics/image_metrics.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "validate.h"

namespace probelab {
namespace {

std::vector<double> luminancesOf(std::span<const Vec3f> pixels, const char* name) {
  requireFinite(pixels, name);
  std::vector<double> values(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) values[i] = luminance(Vec3d(pixels[i]));
  return values;
}

double meanOf(std::size_t count, auto&& term) {
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += term(i);
  return sum / static_cast<double>(count);
}

ImageMetrics metricsOf(const std::vector<double>& e, const std::vector<double>& r) {
  ImageMetrics m;
  for (const double v : e) m.max_abs = std::max(m.max_abs, std::abs(v));
  const std::size_t n = e.size();
  const double mean = meanOf(n, [&](std::size_t i) { return r[i]; });
  if (!(mean > 0)) return m;
  const auto square = [](double v) { return v * v; };
  m.rmse = std::sqrt(meanOf(n, [&](std::size_t i) { return square(e[i] - r[i]); })) / mean;
  m.mae = meanOf(n, [&](std::size_t i) { return std::abs(e[i] - r[i]); }) / mean;
  m.bias = meanOf(n, [&](std::size_t i) { return e[i] - r[i]; }) / mean;
  m.relmse = meanOf(
      n, [&](std::size_t i) { return square(e[i] - r[i]) / (square(r[i]) + square(0.01 * mean)); });
  m.smape = meanOf(n, [&](std::size_t i) {
    return 2 * std::abs(e[i] - r[i]) / (std::abs(e[i]) + std::abs(r[i]) + 1e-3 * mean);
  });
  return m;
}

}  // namespace

ImageMetrics computeImageMetrics(std::span<const Vec3f> estimate,
                                 std::span<const Vec3f> reference) {
  PROBELAB_CHECK_EQ(estimate.size(), reference.size());
  PROBELAB_CHECK(!estimate.empty());
  return metricsOf(luminancesOf(estimate, "image"), luminancesOf(reference, "reference image"));
}

ImageMetrics computeImageMetrics(std::span<const Vec3f> estimate, std::span<const Vec3f> a,
                                 std::span<const Vec3f> b) {
  PROBELAB_CHECK_EQ(estimate.size(), a.size());
  PROBELAB_CHECK_EQ(estimate.size(), b.size());
  PROBELAB_CHECK(!estimate.empty());
  const std::vector<double> e = luminancesOf(estimate, "image");
  const std::vector<double> la = luminancesOf(a, "reference image a");
  const std::vector<double> lb = luminancesOf(b, "reference image b");
  std::vector<double> r(e.size());
  for (std::size_t i = 0; i < r.size(); ++i) r[i] = 0.5 * (la[i] + lb[i]);
  ImageMetrics m = metricsOf(e, r);
  const double product = meanOf(e.size(), [&](std::size_t i) { return la[i] * lb[i]; });
  if (m.rmse && product > 0) {
    const double squared =
        meanOf(e.size(), [&](std::size_t i) { return (e[i] - la[i]) * (e[i] - lb[i]); });
    m.nrmse = std::sqrt(std::max(0.0, squared / product));
  }
  return m;
}

std::vector<std::pair<std::string_view, std::optional<double>>> namedMetrics(
    const ImageMetrics& m) {
  return {{"nrmse", m.nrmse},   {"rmse", m.rmse},   {"mae", m.mae},        {"bias", m.bias},
          {"relmse", m.relmse}, {"smape", m.smape}, {"max_abs", m.max_abs}};
}

}  // namespace probelab
