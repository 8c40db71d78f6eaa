// SPDX-License-Identifier: GPL-3.0-or-later
// Statistical decisions with a level for the whole family of tests (Sidak), and chi-square.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "trace/path_tracer.h"

namespace probelab::test {

inline constexpr double kFamilyLevel = 1e-3;

// Two-sided critical value of a single test so that `tests` independent ones together are rejected
// with probability kFamilyLevel; Student's t with `dof` degrees of freedom by its first-order
// expansion t = z + (z^3 + z) / (4 dof), exact to 1 % for dof >= 60.
inline double criticalT(std::size_t tests, double dof) {
  const double each = -std::expm1(std::log1p(-kFamilyLevel) / static_cast<double>(tests));
  double low = 0, high = 40;
  for (int i = 0; i < 200; ++i) {
    const double z = 0.5 * (low + high);
    (std::erfc(z / std::sqrt(2.0)) > each ? low : high) = z;
  }
  return low + (low * low * low + low) / (4 * dof);
}

// Every point's (A+B)/2 against the truth: z-test at the family's level over points and channels,
// and a hard bound on the bias of their mean, since a noisy test passes anything. `model_error` is
// the truth's own relative error (tessellation), 2e-6 for fp32 sums otherwise.
inline void expectTruth(const IrradianceEstimate& estimate, std::span<const Vec3d> truth,
                        double bias_bound, double model_error = 2e-6) {
  ASSERT_EQ(estimate.a.size(), truth.size());
  const double dof = estimate.samples / 16.0 - 1;
  const double critical = criticalT(3 * truth.size(), dof);
  double sum_error = 0, sum_truth = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Vec3d value = (Vec3d(estimate.a[i]) + Vec3d(estimate.b[i])) * 0.5;
    for (std::size_t c = 0; c < 3; ++c) {
      const double error = value[c] - truth[i][c];
      EXPECT_LE(std::abs(error),
                critical * estimate.standard_error[i][c] + model_error * std::abs(truth[i][c]))
          << "point " << i << " channel " << c << " value " << value[c] << " truth " << truth[i][c]
          << " standard error " << estimate.standard_error[i][c];
      sum_error += error, sum_truth += truth[i][c];
    }
  }
  EXPECT_LE(std::abs(sum_error), bias_bound * sum_truth);
}

inline void expectTruth(const IrradianceEstimate& estimate, double truth, double bias_bound,
                        double model_error = 2e-6) {
  expectTruth(estimate, std::vector<Vec3d>(estimate.a.size(), Vec3d(truth)), bias_bound,
              model_error);
}

// Pearson's statistic of counts against expected counts, bins below 5 merged; true if it is not
// rejected at `level` (Wilson and Hilferty's normal approximation).
inline bool chiSquareAccepts(std::span<const uint64_t> counts, std::span<const double> expected,
                             double level) {
  double statistic = 0, merged_count = 0, merged_expected = 0;
  int bins = 0;
  const auto add = [&](double count, double want) {
    statistic += (count - want) * (count - want) / want;
    ++bins;
  };
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (expected[i] >= 5) {
      add(static_cast<double>(counts[i]), expected[i]);
    } else {
      merged_count += static_cast<double>(counts[i]), merged_expected += expected[i];
    }
  }
  if (merged_expected > 0)
    add(merged_count, merged_expected);
  else if (merged_count > 0)
    return false;  // samples where the density is 0
  const double k = bins - 1;
  const double z = (std::cbrt(statistic / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
  return 0.5 * std::erfc(z / std::sqrt(2.0)) > level;
}

}  // namespace probelab::test
