// SPDX-License-Identifier: Apache-2.0
#include "pass_schedule.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"

namespace probelab {
namespace {

constexpr uint32_t kDefaultSpp = 1024;
// Eight passes give the variance seven degrees of freedom before anything is decided by it.
constexpr uint32_t kFirstPasses = 8;

uint32_t evenUp(double passes) {
  return 2 * static_cast<uint32_t>(std::ceil(std::clamp(passes, 2.0, 2e9) / 2));
}

double varianceOfMean1(double sum, double squares, double n) {
  return std::max(0.0, (squares - sum * sum / n) / ((n - 1) * n));
}

}  // namespace

PassSchedule::PassSchedule(const SampleBudget& budget, uint32_t samples_per_pass)
    : budget_(budget), samples_per_pass_(samples_per_pass) {
  if (!(budget.seconds >= 0) || !std::isfinite(budget.seconds) || !(budget.rel_error >= 0) ||
      !std::isfinite(budget.rel_error))
    throwInput("sample budget: seconds {} and relative error {} must be 0 or positive",
               budget.seconds, budget.rel_error);
  if (budget_.spp == 0 && budget_.seconds == 0 && budget_.rel_error == 0) budget_.spp = kDefaultSpp;
  const uint32_t limit = budget_.spp > 0 ? budget_.spp : std::max(1u, budget_.max_spp);
  max_passes_ = evenUp(static_cast<double>(limit) / samples_per_pass_);
}

// Passes at which the relative error should be reached; errors fall with the root of the samples.
uint32_t PassSchedule::wanted(double rel_error) const {
  if (budget_.rel_error == 0) return max_passes_;
  if (passes_ == 0) return std::min(kFirstPasses, max_passes_);
  const double ratio = rel_error / budget_.rel_error;
  return std::min(max_passes_, evenUp(std::min(ratio * ratio * passes_, 1e9)));
}

uint32_t PassSchedule::next(double rel_error, double elapsed_s) {
  if (passes_ >= max_passes_) return 0;
  if (passes_ > 0 && budget_.rel_error > 0 && rel_error <= budget_.rel_error) return 0;
  double step = std::max<double>(wanted(rel_error), passes_ + 2) - passes_;
  // In steps of a quarter: the first estimates of the error are rough, and progress wants to move.
  step = std::min(step, std::max<double>(kFirstPasses, passes_ / 4));
  if (budget_.seconds > 0) {
    if (passes_ > 0 && elapsed_s >= budget_.seconds) return 0;
    const double per_pass = passes_ > 0 ? elapsed_s / passes_ : 0;
    const double fitting = per_pass > 0 ? (budget_.seconds - elapsed_s) / per_pass : 2;
    step = std::min(step, passes_ == 0 ? 2.0 : std::max(2.0, std::floor(fitting * 0.5) * 2));
  }
  const uint32_t count = std::min(evenUp(step), max_passes_ - passes_);
  passes_ += count;
  return count;
}

double PassSchedule::share(double done, double rel_error, double elapsed_s) const {
  double share = done / std::max(1.0, static_cast<double>(wanted(rel_error)));
  if (budget_.seconds > 0) share = std::max(share, elapsed_s / budget_.seconds);
  return std::clamp(share, 0.0, 1.0);
}

Vec3d PassSums::varianceOfMean() const {
  const double n = passes;
  const Vec3d sum = a + b;
  return {varianceOfMean1(sum.x, squares.x, n), varianceOfMean1(sum.y, squares.y, n),
          varianceOfMean1(sum.z, squares.z, n)};
}

double PassSums::luminanceVarianceOfMean() const {
  return varianceOfMean1(luminance(a + b), luminance_squares, passes);
}

double darkThreshold(std::span<const PassSums> sums) {
  double total = 0;
  for (const PassSums& s : sums) total += luminance(s.mean());
  return 0.01 * total / static_cast<double>(std::max<std::size_t>(1, sums.size()));
}

double relativeError(const PassSums& sums, double threshold) {
  const double reference = std::max(luminance(sums.mean()), threshold);
  return reference > 0 ? std::sqrt(sums.luminanceVarianceOfMean()) / reference : 0;
}

double medianOf(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double meanOf(const std::vector<double>& values) {
  double sum = 0;
  for (double v : values) sum += v;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

}  // namespace probelab
