// SPDX-License-Identifier: Apache-2.0
#include "metrics/error.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "base/error.h"
#include "nearest.h"
#include "validate.h"

namespace probelab {
namespace {

constexpr std::size_t kPooledReceivers = 16;

// One channel (or the luminance) of some receivers, in double; the weights sum to 1.
struct Table {
  std::vector<double> estimate, a, b, weight, sigma;
};

double sumOf(std::size_t count, auto&& term) {
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += term(i);
  return sum;
}

// Channel 0, 1, 2, or the luminance for any other number.
Table makeTable(const ReceiverSamples& s, std::span<const double> variance,
                const std::vector<std::size_t>& chosen, int channel) {
  const auto value = [&](const Vec3f& c) {
    return channel >= 0 && channel < 3 ? double(c[channel]) : luminance(Vec3d(c));
  };
  const double total = sumOf(chosen.size(), [&](std::size_t i) { return s.area[chosen[i]]; });
  Table t;
  for (const std::size_t i : chosen) {
    t.estimate.push_back(value(s.estimate[i]));
    t.a.push_back(value(s.a[i]));
    t.b.push_back(value(s.b[i]));
    t.weight.push_back(s.area[i] / total);
    t.sigma.push_back(std::sqrt(variance[i]));
  }
  return t;
}

// What the reference is compared with: R and its mean.
struct Reference {
  std::vector<double> value;
  double mean = 0;
};

Reference makeReference(const Table& t, bool halves_averaged) {
  Reference r;
  r.value = t.b;
  if (halves_averaged)
    for (std::size_t i = 0; i < t.a.size(); ++i) r.value[i] = 0.5 * (t.a[i] + t.b[i]);
  r.mean = sumOf(t.a.size(), [&](std::size_t i) { return t.weight[i] * r.value[i]; });
  return r;
}

double meanProduct(const Table& t) {
  return sumOf(t.a.size(), [&](std::size_t i) { return t.weight[i] * t.a[i] * t.b[i]; });
}

double biasOf(const Table& t, const Reference& r) {
  return sumOf(t.a.size(),
               [&](std::size_t i) { return t.weight[i] * (t.estimate[i] - r.value[i]); }) /
         r.mean;
}

void fillRelativeErrors(const Table& t, const Reference& r, ErrorMetrics& m) {
  const std::size_t n = t.a.size();
  const auto difference = [&](std::size_t i) { return std::abs(t.estimate[i] - r.value[i]); };
  const double dim = 0.01 * r.mean;
  m.relmse = sumOf(n, [&](std::size_t i) {
    return t.weight[i] * difference(i) * difference(i) / (r.value[i] * r.value[i] + dim * dim);
  });
  m.smape = sumOf(n, [&](std::size_t i) {
    return t.weight[i] * 2 * difference(i) /
           (std::abs(t.estimate[i]) + std::abs(r.value[i]) + 1e-3 * r.mean);
  });
  std::vector<double> relative(n);
  for (std::size_t i = 0; i < n; ++i) relative[i] = difference(i) / (std::abs(r.value[i]) + dim);
  m.p95 = weightedPercentile(relative, t.weight, 0.95);
  m.p99 = weightedPercentile(relative, t.weight, 0.99);
}

void fillLeaks(const Table& t, const Reference& r, ErrorMetrics& m) {
  double light = 0, shadow = 0, dark = 0, dark_weight = 0, area = 0;
  for (std::size_t i = 0; i < t.a.size(); ++i) {
    const double excess = t.estimate[i] - r.value[i];
    if (r.value[i] < 0.1 * r.mean)
      light += t.weight[i] * std::max(0.0, excess - 2 * t.sigma[i]);
    else
      shadow += t.weight[i] * std::max(0.0, -excess - 2 * t.sigma[i]);
    if (r.value[i] < 0.01 * r.mean) {
      dark += t.weight[i] * t.estimate[i];
      dark_weight += t.weight[i];
    }
    if (std::abs(excess) > 0.5 * r.value[i] + 0.05 * r.mean) area += t.weight[i];
  }
  m.light_leak = light / r.mean;
  m.shadow_leak = shadow / r.mean;
  if (dark_weight > 0) m.dark_leak = dark / dark_weight / r.mean;
  m.leak_area = area;
}

// `floor`: the reference's noise instead, Ê := A and R := B.
double squaredError(const Table& t, bool floor) {
  return sumOf(t.a.size(), [&](std::size_t i) {
    const double d = t.a[i] - t.b[i];
    return t.weight[i] * (floor ? d * d / 4 : (t.estimate[i] - t.a[i]) * (t.estimate[i] - t.b[i]));
  });
}

ErrorMetrics tableMetrics(Table luminances, const std::array<Table, 3>& channels, bool floor) {
  ErrorMetrics m;
  if (floor) luminances.estimate = luminances.a;
  for (const double e : luminances.estimate) m.max_abs = std::max(m.max_abs, std::abs(e));
  const Reference reference = makeReference(luminances, !floor);
  const double product = meanProduct(luminances);
  if (product > 0 && reference.mean > 0) {
    m.nrmse = std::sqrt(std::max(0.0, squaredError(luminances, floor) / product));
    m.bias = biasOf(luminances, reference);
    fillRelativeErrors(luminances, reference, m);
    fillLeaks(luminances, reference, m);
  }
  for (std::size_t c = 0; c < 3; ++c) {
    Table t = channels[c];
    if (floor) t.estimate = t.a;
    const Reference r = makeReference(t, !floor);
    const double p = meanProduct(t);
    if (!(p > 0 && r.mean > 0)) continue;
    m.nrmse_rgb[c] = std::sqrt(std::max(0.0, squaredError(t, floor) / p));
    m.bias_rgb[c] = biasOf(t, r);
  }
  return m;
}

struct Both {
  std::optional<ErrorMetrics> metrics, floor;
};

Both metricsOf(const ReceiverSamples& s, std::span<const double> variance,
               const std::vector<std::size_t>& chosen) {
  const double total = sumOf(chosen.size(), [&](std::size_t i) { return s.area[chosen[i]]; });
  if (chosen.empty() || !(total > 0)) return {};
  const Table luminances = makeTable(s, variance, chosen, -1);
  const std::array<Table, 3> channels = {makeTable(s, variance, chosen, 0),
                                         makeTable(s, variance, chosen, 1),
                                         makeTable(s, variance, chosen, 2)};
  return {tableMetrics(luminances, channels, false), tableMetrics(luminances, channels, true)};
}

std::vector<std::size_t> receiversOfKind(const ReceiverSamples& s, int kind) {
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < s.kind.size(); ++i)
    if (s.kind[i] == kind) chosen.push_back(i);
  return chosen;
}

}  // namespace

ErrorReport computeErrors(const ReceiverSamples& samples) {
  validateSamples(samples);
  const std::vector<double> variance = pooledVariance(samples);
  std::vector<std::size_t> everyone(samples.a.size());
  std::iota(everyone.begin(), everyone.end(), std::size_t{0});
  const Both all = metricsOf(samples, variance, everyone);
  const Both surface = metricsOf(samples, variance, receiversOfKind(samples, kSurfaceReceiver));
  const Both volume = metricsOf(samples, variance, receiversOfKind(samples, kVolumeReceiver));
  const double mean = makeReference(makeTable(samples, variance, everyone, -1), true).mean;
  return {*all.metrics, *all.floor, surface.metrics, surface.floor, volume.metrics,
          volume.floor, mean};
}

std::vector<double> pooledVariance(const ReceiverSamples& samples) {
  validateSamples(samples);
  const std::size_t n = samples.a.size();
  std::map<std::pair<int, int>, std::vector<int>> groups;
  for (std::size_t i = 0; i < n; ++i)
    groups[{samples.region.empty() ? 0 : samples.region[i],
            samples.kind.empty() ? 0 : samples.kind[i]}]
        .push_back(static_cast<int>(i));
  std::vector<double> own(n), pooled(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double d = luminance(Vec3d(samples.a[i])) - luminance(Vec3d(samples.b[i]));
    own[i] = d * d / 4;
  }
  std::vector<std::pair<double, int>> nearest;
  for (const auto& [key, members] : groups) {
    const NearestPoints tree(samples.position, members);
    for (const int i : members) {
      tree.query(samples.position[i], kPooledReceivers, nearest);
      double sum = 0;
      for (const auto& [distance, j] : nearest) sum += own[j];
      pooled[i] = sum / static_cast<double>(nearest.size());
    }
  }
  return pooled;
}

double weightedPercentile(std::span<const double> values, std::span<const double> weights,
                          double q) {
  PROBELAB_CHECK(!values.empty() && values.size() == weights.size());
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::pair(values[a], a) < std::pair(values[b], b);
  });
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  // The slack is for the rounding of the sums: 20 weights of 0.05 must reach 0.95 with the 19th.
  const double target = (q - 1e-9) * total;
  double below = 0;
  for (const std::size_t i : order) {
    below += weights[i];
    if (weights[i] > 0 && below >= target) return values[i];
  }
  return values[order.back()];
}

bool isResolved(const std::optional<double>& value, const std::optional<double>& floor) {
  return value && floor && std::abs(*value) > 4 * std::abs(*floor);
}

std::vector<std::pair<std::string_view, std::optional<double>>> namedMetrics(
    const ErrorMetrics& m) {
  return {{"nrmse", m.nrmse},
          {"bias", m.bias},
          {"relmse", m.relmse},
          {"smape", m.smape},
          {"p95", m.p95},
          {"p99", m.p99},
          {"light_leak", m.light_leak},
          {"shadow_leak", m.shadow_leak},
          {"dark_leak", m.dark_leak},
          {"leak_area", m.leak_area},
          {"max_abs", m.max_abs}};
}

}  // namespace probelab
