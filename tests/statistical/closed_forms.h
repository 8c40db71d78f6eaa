// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance in closed form, L = radiance. Numbers of the formulas' origin: view factor catalogues
// (Howell); each was checked against quadrature.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "base/vec.h"

namespace probelab::test {

// Lambert's formula: polygon of radiance L, clipped to the horizon of the normal n at p.
inline double polygonIrradiance(const Vec3d& p, const Vec3d& n, std::span<const Vec3d> corners,
                                double radiance) {
  std::vector<Vec3d> above;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec3d a = corners[i] - p, b = corners[(i + 1) % corners.size()] - p;
    const double da = dot(a, n), db = dot(b, n);
    if (da >= 0) above.push_back(a);
    if (da * db < 0) above.push_back(a + (b - a) * (da / (da - db)));
  }
  double sum = 0;
  for (std::size_t i = 0; i < above.size(); ++i) {
    const Vec3d &a = above[i], &b = above[(i + 1) % above.size()];
    const Vec3d c = cross(a, b);
    const double l = length(c);
    if (l > 1e-30) sum += std::atan2(l, dot(a, b)) * dot(c, n) / l;
  }
  return 0.5 * radiance * std::abs(sum);
}

// View factor from an element parallel to a disc of radius r at height h, offset a sideways.
inline double discFactor(double h, double r, double a) {
  if (a == 0) return r * r / (r * r + h * h);
  const double big_h = h / a, big_r = r / a, z = 1 + big_h * big_h + big_r * big_r;
  return 0.5 * (1 - (1 + big_h * big_h - big_r * big_r) / std::sqrt(z * z - 4 * big_r * big_r));
}

// View factor from an element to a sphere of radius R whose centre is at distance d, theta from the
// normal; exact where the horizon cuts the sphere.
inline double sphereFactor(double radius, double d, double theta) {
  const double h = d / radius, reach = std::asin(1 / h);
  if (theta <= M_PI / 2 - reach) return std::cos(theta) / (h * h);
  if (theta >= M_PI / 2 + reach) return 0;
  const double q = std::sqrt(h * h - 1), c = std::cos(theta);
  return 0.5 - std::asin(q / (h * std::sin(theta))) / M_PI +
         (c * std::acos(std::clamp(-q / std::tan(theta), -1.0, 1.0)) -
          q * std::sqrt(std::max(0.0, 1 - h * h * c * c))) /
             (M_PI * h * h);
}

}  // namespace probelab::test
