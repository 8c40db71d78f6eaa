// SPDX-License-Identifier: Apache-2.0
#include "ddgi/texel_fit.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "base/vec.h"
#include "shared/octahedral.h"

namespace probelab {
namespace {

constexpr int kSubsamples = 8;  // a side of a texel, of the integrals over the sphere
constexpr int kHighestDegree = 8;

// Highest degree whose harmonics, (degree + 1)^2 of them, are at most half of the texels.
int degreeFor(int n) {
  int degree = 0;
  while (degree < kHighestDegree && 2 * (degree + 2) * (degree + 2) <= n * n) ++degree;
  return degree;
}

// Real spherical harmonics up to `degree` without their constant factors, which no projection
// needs: associated Legendre functions by their recurrence, scaled by 1 / (2m - 1)!! to stay
// near 1.
Eigen::RowVectorXd harmonics(const Vec3d& d, int degree) {
  const int size = degree + 1;
  Eigen::RowVectorXd values(size * size);
  double cosine = 1, sine = 0, p_mm = 1;  // cos(m phi) and sin(m phi) times sin^m(theta)
  for (int m = 0; m <= degree; ++m) {
    double before = 0, p = p_mm;
    for (int l = m; l <= degree; ++l) {
      values[l * l + l + m] = p * cosine;
      if (m > 0) values[l * l + l - m] = p * sine;
      const double next = ((2 * l + 1) * d.z * p - (l + m) * before) / (l - m + 1);
      before = p;
      p = next;
    }
    const double c = cosine * d.x - sine * d.y;
    sine = cosine * d.y + sine * d.x;
    cosine = c;
  }
  return values;
}

// Solid angle of a small square of the map, edge h in [-1, 1]^2, around direction d: the map's
// density is |d|_1^3 on the unit sphere.
double solidAngle(const Vec3d& d, double h) {
  const double l1 = std::abs(d.x) + std::abs(d.y) + std::abs(d.z);
  return h * h * l1 * l1 * l1;
}

}  // namespace

Eigen::MatrixXd bilinearFit(int n) {
  const int texels = n * n, degree = degreeFor(n), count = (degree + 1) * (degree + 1);
  Eigen::MatrixXd samples(texels, count), weighted(texels, count);
  for (int t = 0; t < texels; ++t) {
    const Vec3d d = texelDirection<double>(t % n, t / n, n);
    samples.row(t) = harmonics(d, degree);
    weighted.row(t) = samples.row(t) * solidAngle(d, 2.0 / n);
  }
  const Eigen::MatrixXd projection =
      (samples.transpose() * weighted).ldlt().solve(weighted.transpose());
  // Normal equations of min over f of the integral of (sum_t B_t f_t - Y c)^2.
  Eigen::MatrixXd overlaps = Eigen::MatrixXd::Zero(texels, texels);
  Eigen::MatrixXd moments = Eigen::MatrixXd::Zero(texels, count);
  const int fine = n * kSubsamples;
  for (int i = 0; i < fine * fine; ++i) {
    const Vec3d d = texelDirection<double>(i % fine, i / fine, fine);
    const double area = solidAngle(d, 2.0 / fine);
    const OctTaps<double> t = octTaps(d, n, 0);
    const int at[4] = {t.texel_00, t.texel_10, t.texel_01, t.texel_11};
    const double fx = t.fraction_x, fy = t.fraction_y;
    const double basis[4] = {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy};
    const Eigen::RowVectorXd y = harmonics(d, degree);
    for (int a = 0; a < 4; ++a) {
      moments.row(at[a]) += area * basis[a] * y;
      for (int b = 0; b < 4; ++b) overlaps(at[a], at[b]) += area * basis[a] * basis[b];
    }
  }
  const Eigen::MatrixXd fitted = overlaps.ldlt().solve(moments);
  return Eigen::MatrixXd::Identity(texels, texels) + (fitted - samples) * projection;
}

}  // namespace probelab
