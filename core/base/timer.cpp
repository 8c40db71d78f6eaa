// SPDX-License-Identifier: Apache-2.0
#include "base/timer.h"

#include <algorithm>
#include <cmath>

namespace probelab {

double percentile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const double position = q * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(std::floor(position));
  const std::size_t above = std::min(below + 1, values.size() - 1);
  const double fraction = position - static_cast<double>(below);
  return values[below] + fraction * (values[above] - values[below]);
}

TimeSummary summarizeTimes(const std::vector<double>& times) {
  return {percentile(times, 0.5), percentile(times, 0.05), percentile(times, 0.95),
          static_cast<int>(times.size())};
}

}  // namespace probelab
