// SPDX-License-Identifier: Apache-2.0
#include "ddgi/run_field.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/interrupt.h"

namespace probelab {
namespace {

constexpr double kForget = 0.1;  // share of the burn-in's own error that may remain
constexpr int kMaxMixing = 64;
constexpr double kRoundingFloor = 2e-3;  // relative change that a small format may keep up for ever

// Change between two fields relative to the newer one, in linear irradiance.
double relativeChange(const std::vector<Vec3f>& before, const std::vector<Vec3f>& after,
                      double gamma) {
  const auto linear = [gamma](float stored) {
    return std::pow(static_cast<double>(stored), gamma);
  };
  double change = 0, total = 0;
  for (std::size_t i = 0; i < after.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) {
      const double now = linear(after[i][c]);
      change += std::abs(now - linear(before[i][c]));
      total += now;
    }
  return total > 0 ? change / total : 0;
}

// Decides from the sequence of relative changes whether a geometric series has ended.
class SettleTest {
 public:
  explicit SettleTest(double tolerance) : tolerance_(tolerance) {}

  bool add(double change) {
    changes_.push_back(change);
    const std::size_t n = changes_.size();
    if (change == 0) {
      remaining_ = 0;
      return true;
    }
    if (n < 3) return false;
    ratio_ = std::clamp(std::sqrt(change / changes_[n - 3]), 0.0, 0.99999);
    remaining_ = change * ratio_ / (1 - ratio_);
    if (remaining_ <= tolerance_) return true;
    // A format's rounding keeps a small change alive: stop once it no longer falls.
    constexpr std::size_t kWindow = 8;
    return n > kWindow && change < kRoundingFloor && change > 0.98 * changes_[n - 1 - kWindow];
  }
  double ratio() const { return ratio_; }
  double remaining() const { return remaining_; }

 private:
  double tolerance_, ratio_ = 0, remaining_ = 1;
  std::vector<double> changes_;
};

int mixingUpdates(double ratio) {
  if (ratio <= kForget) return 1;
  return std::min(kMaxMixing, static_cast<int>(std::ceil(std::log(kForget) / std::log(ratio))));
}

}  // namespace

ConvergeReport convergeField(ProbeField& field, const ConvergeOptions& options,
                             const UpdateCallback& on_update) {
  PROBELAB_CHECK(field.options().accumulate);
  ConvergeReport report;
  SettleTest settle(options.tolerance);
  std::vector<Vec3f> before = field.irradianceTexels();
  report.settled = false;
  while (!report.settled && report.burn_in_updates < options.max_burn_in) {
    throwIfInterrupted();
    field.update(0, {}, {});
    ++report.burn_in_updates;
    std::vector<Vec3f> after = field.irradianceTexels();
    report.settled = settle.add(relativeChange(before, after, field.params().encoding_gamma));
    before = std::move(after);
    if (on_update) on_update(report.burn_in_updates, 0);
  }
  report.contraction = settle.ratio();
  report.remaining = settle.remaining();
  report.mixing_updates = mixingUpdates(settle.ratio());
  report.average_updates = options.average;
  const int total = report.updates();
  for (int i = 0; i < report.mixing_updates + options.average; ++i) {
    throwIfInterrupted();
    BlendMode moments{.average_of = static_cast<uint32_t>(i + 1), .store_average = true};
    BlendMode irradiance;
    if (i >= report.mixing_updates) {
      irradiance.average_of = static_cast<uint32_t>(i - report.mixing_updates + 1);
      irradiance.store_average = i + 1 == report.mixing_updates + options.average;
    }
    field.update(static_cast<uint64_t>(i + 1), irradiance, moments);
    if (on_update) on_update(report.burn_in_updates + i + 1, total);
  }
  return report;
}

int runTemporal(ProbeField& field, int updates, const UpdateCallback& on_update) {
  const double threshold = field.params().variability_threshold;
  for (int i = 0; i < updates; ++i) {
    throwIfInterrupted();
    const BlendMode mode{.hysteresis =
                             i == 0 ? 0.0f : static_cast<float>(field.params().hysteresis)};
    field.update(static_cast<uint64_t>(i), mode, mode);
    if (on_update) on_update(i + 1, updates);
    if (threshold > 0 && field.variability() < threshold) return i + 1;
  }
  return updates;
}

}  // namespace probelab
