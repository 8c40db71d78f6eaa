// SPDX-License-Identifier: Apache-2.0
// How many passes to trace before looking at the error or the clock again, and when to stop; shared
// by receivers and images.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/vec.h"
#include "trace/path_tracer.h"

namespace probelab {

class PassSchedule {
 public:
  // Throws InputError for a negative or non-finite budget.
  PassSchedule(const SampleBudget& budget, uint32_t samples_per_pass);

  // Passes to add now, even; 0: done. `rel_error` is what the passes so far reached.
  uint32_t next(double rel_error, double elapsed_s);
  // Counts `passes` as already traced.
  void resume(uint32_t passes) { passes_ = passes; }
  uint32_t passes() const { return passes_; }
  uint32_t samples() const { return passes_ * samples_per_pass_; }
  // Estimate of the share done after `done` of the passes, in [0, 1].
  double share(double done, double rel_error, double elapsed_s) const;

 private:
  uint32_t wanted(double rel_error) const;

  SampleBudget budget_;
  uint32_t samples_per_pass_;
  uint32_t max_passes_;
  uint32_t passes_ = 0;
};

// Sums over the passes of one point or pixel; even passes belong to half A, odd ones to B.
struct PassSums {
  Vec3d a, b, squares;
  double luminance_squares = 0;
  uint32_t passes = 0;

  void add(uint32_t pass, const Vec3d& mean) {
    (pass % 2 == 0 ? a : b) += mean;
    squares += mean * mean;
    const double y = luminance(mean);
    luminance_squares += y * y;
    ++passes;
  }
  Vec3f halfA() const { return Vec3f(a / (0.5 * passes)); }
  Vec3f halfB() const { return Vec3f(b / (0.5 * passes)); }
  Vec3d mean() const { return (a + b) / static_cast<double>(passes); }
  // Variance of mean(), from the scatter of the passes.
  Vec3d varianceOfMean() const;
  double luminanceVarianceOfMean() const;
};

// What counts as dark: 0.01 of the mean luminance.
double darkThreshold(std::span<const PassSums> sums);

// Standard error of one value over the value itself, or over the threshold where it is dark. 0
// where everything is black.
double relativeError(const PassSums& sums, double threshold);

// 0 for no values.
double medianOf(std::vector<double> values);
double meanOf(const std::vector<double>& values);

}  // namespace probelab
