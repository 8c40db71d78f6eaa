// SPDX-License-Identifier: Apache-2.0
#include "ddgi/run_field.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/interrupt.h"

namespace probelab {
namespace {

constexpr double kForget = 0.1;  // share of the burn-in's own error that may remain
constexpr int kMaxMixing = 64;
constexpr double kSettledRemaining = 5e-3;  // more than that is said to the user
// Directions that find no light at all are replaced, so many times: few rays may miss a small lamp.
constexpr int kBlackUpdates = 32;
constexpr uint64_t kOtherRotations = uint64_t{1} << 32;
constexpr double kRoundingFloor = 2e-3;  // relative change that a small format may keep up for ever

// Sum of the field's linear irradiance over texels and channels.
double fieldSum(const std::vector<Vec3f>& texels, double gamma) {
  double sum = 0;
  for (const Vec3f& texel : texels)
    for (std::size_t c = 0; c < 3; ++c) sum += std::pow(static_cast<double>(texel[c]), gamma);
  return sum;
}

// Relative change of linear irradiance below which nearest rounding may leave a stored texel as it
// is: half a unit in the last place at the bottom of a binade, times gamma.
double stallUnit(const Params& params) {
  switch (params.irradiance_format) {
    case PL_FORMAT_RGBA32F:
      return params.encoding_gamma * 0x1p-24;
    case PL_FORMAT_RGBA16F:
      return params.encoding_gamma * 0x1p-11;
    case PL_FORMAT_R11G11B10F:
      return params.encoding_gamma * 0x1p-6;  // of the blue channel
    default:
      return params.encoding_gamma * 0x1p-10;  // at half of full scale
  }
}

// Decides from the sums of the field after each update, which rise geometrically from black,
// whether the series has ended. (Sums, because dithered rounding never leaves all texels alone.)
class SettleTest {
 public:
  SettleTest(double tolerance, const Params& params)
      : tolerance_(tolerance),
        stall_unit_(params.rounding == 0 ? stallUnit(params) : 0),
        rounded_(params.irradiance_format != PL_FORMAT_RGBA32F),
        dithered_(rounded_ && params.rounding != 0),
        clean_above_(rounded_ ? 4 * std::max(kRoundingFloor, stall_unit_) : 0) {}

  bool add(double before, double after) {
    const double change = after > 0 ? std::abs(after - before) / after : 0;
    changes_.push_back(change);
    const std::size_t n = changes_.size();
    if (change == 0) {
      // What is still missing may be too small a step for the format.
      remaining_ = after > 0 ? stall_unit_ / (1 - ratio_) : 0;
      return true;
    }
    if (n < 3) return false;
    // Small formats bury a small change in rounding noise: then the last clean ratio counts.
    if (change > clean_above_ || n <= 4) ratio_ = ratioNow();
    const double level = rounded_ ? meanOfLast(std::min(n, kWindow)) : change;
    remaining_ = level * ratio_ / (1 - ratio_);
    if (remaining_ <= tolerance_) return true;
    return rounded_ && n >= 2 * kWindow && level < kRoundingFloor &&
           level > 0.95 * meanOfLast(kWindow, kWindow);
  }
  double ratio() const { return ratio_; }
  double remaining() const { return remaining_; }

 private:
  static constexpr std::size_t kWindow = 8;

  // Over eight steps as soon as there are so many, because dither makes single ones odd; without it
  // over two where that is larger, because the ratio of a series from black still rises.
  double ratioNow() const {
    const std::size_t n = changes_.size();
    const auto over = [&](std::size_t steps) {
      return std::pow(changes_[n - 1] / changes_[n - 1 - steps], 1.0 / static_cast<double>(steps));
    };
    double ratio = over(n > kWindow ? kWindow : 2);
    if (!dithered_) ratio = std::max(ratio, over(2));
    return std::clamp(ratio, 0.0, 0.99999);
  }
  double meanOfLast(std::size_t count, std::size_t skip = 0) const {
    const auto last = changes_.end() - static_cast<std::ptrdiff_t>(skip);
    return std::accumulate(last - static_cast<std::ptrdiff_t>(count), last, 0.0) /
           static_cast<double>(count);
  }

  double tolerance_, stall_unit_;
  bool rounded_, dithered_;
  double clean_above_;  // changes that rounding does not disturb
  double ratio_ = 0, remaining_ = 1;
  std::vector<double> changes_;
};

int mixingUpdates(double ratio) {
  if (ratio <= kForget) return 1;
  return std::min(kMaxMixing, static_cast<int>(std::ceil(std::log(kForget) / std::log(ratio))));
}

// Fills the report's burn-in part.
void burnIn(ProbeField& field, const ConvergeOptions& options, const UpdateCallback& on_update,
            ConvergeReport& report) {
  const double gamma = field.params().encoding_gamma;
  SettleTest settle(options.tolerance, field.params());
  double before = fieldSum(field.irradianceTexels(), gamma);
  bool ended = false;
  uint64_t rotation = 0;
  while (!ended && report.burn_in_updates < options.max_burn_in) {
    throwIfInterrupted();
    field.update(rotation, {}, {});
    ++report.burn_in_updates;
    const double after = fieldSum(field.irradianceTexels(), gamma);
    if (after == 0 && report.burn_in_updates < kBlackUpdates) {
      rotation = kOtherRotations + static_cast<uint64_t>(report.burn_in_updates);
    } else {
      ended = settle.add(before, after);
      before = after;
    }
    if (on_update) on_update(report.burn_in_updates, 0);
  }
  report.contraction = settle.ratio();
  report.remaining = settle.remaining();
  report.settled = ended && settle.remaining() <= std::max(options.tolerance, kSettledRemaining);
}

}  // namespace

ConvergeReport convergeField(ProbeField& field, const ConvergeOptions& options,
                             const UpdateCallback& on_update) {
  PROBELAB_CHECK(field.options().accumulate);
  ConvergeReport report;
  burnIn(field, options, on_update, report);
  report.mixing_updates = mixingUpdates(report.contraction);
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

float temporalHysteresis(const Params& params, int update) {
  if (update == 0 || update < params.warm_up) return 0;
  if (params.warm_up == 0) return static_cast<float>(params.hysteresis);
  const double averaged = update - params.warm_up + 1;  // updates that the history stands for
  return static_cast<float>(std::min(params.hysteresis, averaged / (averaged + 1)));
}

int runTemporal(ProbeField& field, int updates, const UpdateCallback& on_update) {
  const double threshold = field.params().variability_threshold;
  for (int i = 0; i < updates; ++i) {
    throwIfInterrupted();
    const BlendMode mode{.hysteresis = temporalHysteresis(field.params(), i)};
    field.update(static_cast<uint64_t>(i), mode, mode);
    if (on_update) on_update(i + 1, updates);
    if (threshold > 0 && field.variability() < threshold) return i + 1;
  }
  return updates;
}

}  // namespace probelab
