// SPDX-License-Identifier: GPL-3.0-or-later
#include "closed_forms.h"

#include <algorithm>
#include <cmath>

namespace probelab {
namespace {

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
