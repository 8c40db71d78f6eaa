// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/maxent.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace probelab {
namespace {

constexpr int kIterations = 24;
constexpr float kGive = 0.01f;       // stiffness of the multiplier, so that it stays finite
constexpr float kTolerance = 1e-4f;  // of the centroid, over the support
constexpr float kLargestStep = 12;   // of the multiplier

// At most so many points, kept by components so that loops over them are vectorised.
constexpr std::size_t kMost = 64;
struct Points {
  std::size_t count = 0;  // a multiple of 4; those added have prior 0
  float x[kMost], y[kMost], z[kMost], prior[kMost], share[kMost];
};

// Mean and second moments of the offsets under the shares of a multiplier.
struct Moments {
  Vec3f mean;
  float xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
};

// e^x to 2e-6 for x <= 0 (2^floor by the exponent's bits, the rest by a polynomial).
inline float expOfNegative(float x) {
  const float t = std::max(x, -80.0f) * 1.44269504f;
  const int whole = static_cast<int>(t) - 1;
  const float f = (t - static_cast<float>(whole)) * 0.69314718f - 0.69314718f;  // [-ln 2, ln 2]
  const float p =
      1 +
      f * (1 + f * (0.5f + f * (1.6666667e-1f +
                                f * (4.1666667e-2f + f * (8.3333333e-3f + f * 1.3888889e-3f)))));
  return std::bit_cast<float>((whole + 1 + 127) << 23) * p;
}

Moments momentsAt(const Vec3f& lambda, Points& p) {
  float largest = -1e30f;
  for (std::size_t i = 0; i < p.count; ++i) {
    p.share[i] = lambda.x * p.x[i] + lambda.y * p.y[i] + lambda.z * p.z[i];
    largest = std::max(largest, p.prior[i] > 0 ? p.share[i] : -1e30f);
  }
  float sum = 0;
  for (std::size_t i = 0; i < p.count; ++i)
    p.share[i] = p.prior[i] * expOfNegative(std::min(p.share[i] - largest, 0.0f));
  for (std::size_t i = 0; i < p.count; ++i) sum += p.share[i];
  const float scale = 1 / sum;
  Moments m;
  for (std::size_t i = 0; i < p.count; ++i) {
    const float w = p.share[i] *= scale;
    const float x = w * p.x[i], y = w * p.y[i], z = w * p.z[i];
    m.mean.x += x, m.mean.y += y, m.mean.z += z;
    m.xx += x * p.x[i], m.xy += x * p.y[i], m.xz += x * p.z[i];
    m.yy += y * p.y[i], m.yz += y * p.z[i], m.zz += z * p.z[i];
  }
  return m;
}

// Solves (covariance + give I) x = b.
Vec3f newtonStep(const Moments& m, const Vec3f& b) {
  const Vec3f& c = m.mean;
  const float xx = m.xx - c.x * c.x + kGive, yy = m.yy - c.y * c.y + kGive,
              zz = m.zz - c.z * c.z + kGive, xy = m.xy - c.x * c.y, xz = m.xz - c.x * c.z,
              yz = m.yz - c.y * c.z;
  const Vec3f row_x(yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
  const Vec3f row_y(row_x.y, xx * zz - xz * xz, xy * xz - xx * yz);
  const Vec3f row_z(row_x.z, row_y.z, xx * yy - xy * xy);
  const float determinant = xx * row_x.x + xy * row_x.y + xz * row_x.z;
  return Vec3f(dot(row_x, b), dot(row_y, b), dot(row_z, b)) / determinant;
}

}  // namespace

float maxentPrior(float q, float sharpness) {
  const float rest = std::max(0.0f, 1 - q);
  return rest * rest * std::exp(-sharpness * q * q);
}

// Newton's method on log sum prior exp(lambda . offset) + give / 2 lambda^2. It is convex; where a
// step does not lower the gradient it is halved.
void maxentShares(std::span<const Vec3f> offsets, std::span<const float> priors,
                  std::span<float> shares) {
  Points p;
  const std::size_t given = std::min(offsets.size(), kMost);
  p.count = (given + 3) / 4 * 4;
  for (std::size_t i = 0; i < p.count; ++i) {
    const Vec3f d = i < given ? offsets[i] : Vec3f();
    p.x[i] = d.x, p.y[i] = d.y, p.z[i] = d.z;
    p.prior[i] = i < given ? priors[i] : 0.0f;
  }
  Vec3f lambda;
  Moments m = momentsAt(lambda, p);
  Vec3f gradient = m.mean;
  for (int i = 0; i < kIterations && length(gradient) > kTolerance; ++i) {
    Vec3f step = newtonStep(m, gradient);
    const float size = length(step);
    if (!(size < 1e30f)) break;
    if (size > kLargestStep) step *= kLargestStep / size;
    for (int half = 0; half < 8; ++half) {
      const Vec3f next = lambda - step;
      const Moments at = momentsAt(next, p);
      const Vec3f next_gradient = at.mean + next * kGive;
      if (length(next_gradient) < length(gradient) || half == 7) {
        lambda = next, m = at, gradient = next_gradient;
        break;
      }
      step *= 0.5f;
    }
  }
  for (std::size_t i = 0; i < shares.size(); ++i) shares[i] = i < given ? p.share[i] : 0.0f;
}

}  // namespace probelab
