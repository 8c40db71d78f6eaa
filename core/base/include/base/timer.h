// SPDX-License-Identifier: Apache-2.0
// Host timing by the steady clock, and the summary that every reported time uses.
#pragma once

#include <chrono>
#include <vector>

namespace probelab {

class Timer {
 public:
  Timer() : start_(std::chrono::steady_clock::now()) {}
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  double milliseconds() const { return seconds() * 1e3; }

 private:
  std::chrono::steady_clock::time_point start_;
};

struct TimeSummary {
  double median = 0, p5 = 0, p95 = 0;
  int samples = 0;
};

// Percentile q in [0, 1] with linear interpolation between order statistics; 0 when empty.
double percentile(std::vector<double> values, double q);
TimeSummary summarizeTimes(const std::vector<double>& times);

}  // namespace probelab
