// SPDX-License-Identifier: GPL-3.0-or-later
// Directions for tests, not by the project's own sampling.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/rng.h"
#include "base/vec.h"

namespace probelab::test {

// Uniform on the sphere.
inline Vec3d randomUnitDouble(Rng& rng) {
  const double z = 1 - 2 * rng.nextDouble(), phi = 2 * std::numbers::pi * rng.nextDouble();
  const double s = std::sqrt(std::max(0.0, 1 - z * z));
  return {s * std::cos(phi), s * std::sin(phi), z};
}
inline Vec3f randomUnit(Rng& rng) { return Vec3f(randomUnitDouble(rng)); }

}  // namespace probelab::test
