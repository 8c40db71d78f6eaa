// SPDX-License-Identifier: GPL-3.0-or-later
#include "closed_forms.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace probelab {
namespace {

using std::numbers::pi;

int mantissaBits(const std::string& format, std::size_t channel) {
  if (format == "rgba32f") return 23;
  if (format == "rgba16f") return 10;
  return channel == 2 ? 5 : 6;
}

}  // namespace

double polygonIrradiance(std::span<const Vec3d> corners, const Vec3d& point, const Vec3d& normal) {
  double sum = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec3d a = normalize(corners[i] - point);
    const Vec3d b = normalize(corners[(i + 1) % corners.size()] - point);
    const Vec3d axis = cross(a, b);
    sum += std::atan2(length(axis), dot(a, b)) * dot(normalize(axis), normal);
  }
  return std::abs(sum) / 2;
}

std::vector<double> irradianceOf(std::span<const Vec3d> normals,
                                 const std::function<double(const Vec3d&)>& radiance) {
  constexpr int kHeights = 512, kAngles = 1024;
  constexpr double kCell = 4 * pi / (kHeights * kAngles);
  std::vector<double> sums(normals.size(), 0);
  for (int i = 0; i < kHeights; ++i)
    for (int j = 0; j < kAngles; ++j) {
      const double z = 2 * (i + 0.5) / kHeights - 1, s = std::sqrt(1 - z * z);
      const double phi = 2 * pi * (j + 0.5) / kAngles;
      const Vec3d w(s * std::cos(phi), s * std::sin(phi), z);
      const double flux = radiance(w) * kCell;
      for (std::size_t k = 0; k < normals.size(); ++k)
        sums[k] += flux * std::max(0.0, dot(normals[k], w));
    }
  return sums;
}

double formatUlp(const std::string& format, std::size_t channel, double value) {
  if (format == "rgb10a2") return 1.0 / 1023;
  int exponent = 0;
  std::frexp(value, &exponent);  // value = m 2^exponent, m in [0.5, 1)
  const int least = format == "rgba32f" ? -126 : -14;
  return std::ldexp(1.0, std::max(exponent - 1, least) - mantissaBits(format, channel));
}

double formatLargest(const std::string& format) {
  if (format == "rgba32f") return 3.4028234e38;
  if (format == "rgba16f") return 65504;
  return format == "r11g11b10f" ? 64512 : 1;
}

double formatSmallestNormal(const std::string& format) {
  if (format == "rgba32f") return 0x1p-126;
  return format == "rgb10a2" ? 1.0 / 1023 : 0x1p-14;
}

}  // namespace probelab
