// SPDX-License-Identifier: Apache-2.0
#include "ddgi/directions.h"

#include <cmath>
#include <numbers>

#include "base/rng.h"

namespace probelab {

std::vector<Vec3d> sphericalFibonacci(int n) {
  std::vector<Vec3d> points;
  for (int i = 0; i < n; ++i) {
    const double turns = i * (std::numbers::phi - 1);
    const double phi = 2 * std::numbers::pi * (turns - std::floor(turns));
    const double cosine = 1 - (2.0 * i + 1) / n;
    const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    points.emplace_back(std::cos(phi) * sine, std::sin(phi) * sine, cosine);
  }
  return points;
}

std::array<Vec3d, 3> randomRotation(uint64_t seed, uint64_t update) {
  Rng rng(seed, RngStream::rotation, update);
  const double u = rng.nextDouble();
  const double a = 2 * std::numbers::pi * rng.nextDouble();
  const double b = 2 * std::numbers::pi * rng.nextDouble();
  const double x = std::sqrt(1 - u) * std::sin(a), y = std::sqrt(1 - u) * std::cos(a);
  const double z = std::sqrt(u) * std::sin(b), w = std::sqrt(u) * std::cos(b);
  return {Vec3d(1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
          Vec3d(2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
          Vec3d(2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y))};
}

std::vector<Vec3f> updateDirections(int n, uint64_t seed, uint64_t update) {
  const std::array<Vec3d, 3> rows = randomRotation(seed, update);
  std::vector<Vec3f> directions;
  for (const Vec3d& p : sphericalFibonacci(n))
    directions.emplace_back(
        Vec3f(normalize(Vec3d(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p)))));
  return directions;
}

}  // namespace probelab
