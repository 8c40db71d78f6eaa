// SPDX-License-Identifier: GPL-3.0-or-later
// ceres::Jet for the shared query. To be included before every other header that has the query: the
// functions here are those that it finds where Ceres' own have no finite derivative.
#pragma once

#ifdef PROBELAB_SHARED_QUERY_H
#error "jet.h comes before ddgi/snapshot.h"
#endif

#include <ceres/jet.h>

#include <cmath>

#include "base/vec.h"

namespace probelab {

// The root of 0 has no derivative: a probe of weight 0 has none either.
template <int N>
ceres::Jet<double, N> sqrt(const ceres::Jet<double, N>& x) {
  const double root = std::sqrt(x.a);
  if (root == 0) return ceres::Jet<double, N>(0.0);
  return ceres::Jet<double, N>(root, x.v * (0.5 / root));
}

// x^e for x >= 0; at 0 without derivative, which is the limit for e > 1.
template <int N>
ceres::Jet<double, N> powParameter(const ceres::Jet<double, N>& x, const ceres::Jet<double, N>& e,
                                   int /*halves*/) {
  if (x.a == 0) return ceres::Jet<double, N>(std::pow(0.0, e.a));
  const double power = std::pow(x.a, e.a);
  return ceres::Jet<double, N>(power, x.v * (e.a * power / x.a) + e.v * (power * std::log(x.a)));
}

// Of texels, which depend on the parallax by where they are read; the exponent that decodes them is
// not tuned.
template <int N>
Vec3<ceres::Jet<double, N>> powParameter(const Vec3<ceres::Jet<double, N>>& x,
                                         const ceres::Jet<double, N>& e, int halves) {
  if (e.a == 1) return x;
  if (e.a == 0.5) return {sqrt(x.x), sqrt(x.y), sqrt(x.z)};
  return {powParameter(x.x, e, halves), powParameter(x.y, e, halves),
          powParameter(x.z, e, halves)};
}

}  // namespace probelab

#include "ddgi/snapshot.h"
