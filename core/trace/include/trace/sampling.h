// SPDX-License-Identifier: Apache-2.0
// Sampling of directions and triangles, with exact densities. Random numbers are in [0, 1).
#pragma once

#include <algorithm>
#include <cmath>

#include "base/vec.h"

namespace probelab {

inline constexpr float kPi = 3.14159265358979f;

// Two unit vectors that make a right-handed frame with the unit vector n (Duff et al., Building an
// Orthonormal Basis, Revisited, JCGT 6(1), 2017).
struct Frame {
  Vec3f x, y, z;
};
inline Frame frameAround(const Vec3f& n) {
  const float sign = std::copysign(1.0f, n.z);
  const float a = -1.0f / (sign + n.z);
  const float b = n.x * n.y * a;
  return {Vec3f(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x),
          Vec3f(b, sign + n.y * n.y * a, -n.y), n};
}

// Density cos / pi about n.
inline Vec3f sampleCosine(const Vec3f& n, const Vec2f& u) {
  const Frame frame = frameAround(n);
  const float r = std::sqrt(u.x), phi = 2.0f * kPi * u.y;
  return frame.x * (r * std::cos(phi)) + frame.y * (r * std::sin(phi)) +
         frame.z * std::sqrt(std::max(0.0f, 1.0f - u.x));
}

// Density 1 / (4 pi).
inline Vec3f sampleSphere(const Vec2f& u) {
  const float z = 1.0f - 2.0f * u.x, phi = 2.0f * kPi * u.y;
  const float r = std::sqrt(std::max(0.0f, 1.0f - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

// Uniform by area: weights of the second and third vertex (as in Hit).
inline Vec2f sampleTriangle(const Vec2f& u) {
  const float root = std::sqrt(u.x);
  return {root * (1.0f - u.y), root * u.y};
}

// Weight of a strategy with density a against one with density b (Veach's power heuristic, exponent
// 2), also where a or b is infinite.
inline float powerHeuristic(float a, float b) {
  if (!(a > 0)) return 0;
  const float q = b / a;
  return 1.0f / (1.0f + q * q);
}

}  // namespace probelab
