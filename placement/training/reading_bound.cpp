// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/reading_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "placement/maxent.h"
#include "placement/subset_model.h"

namespace probelab {
namespace {

constexpr std::size_t kProbes = 20;
constexpr std::size_t kNearest = 12;  // of these, that have weight to begin with
constexpr float kSharpness = 10;
constexpr std::array kPulls = {0.01, 0.1, 1.0, 10.0, 1000.0};  // x the mean square of the errors
constexpr float kOffSurface = 1e-4f;  // of the scene's extent, where a receiver looks from
constexpr float kLeftOut = 1e-3f;     // share of the way before a probe
constexpr double kDim = 0.02;         // of the mean: a root's slope is that of no darker place
constexpr int kSteps = 400;

// The probes that a receiver sees: what they say under every state, as the query averages it, and
// weights to begin with.
struct SeenProbes {
  std::size_t count = 0;
  std::vector<float> values;  // [probe][state]
  std::vector<double> prior;
};

// Times the maximum-entropy weights of the nearest; sum 1.
void interpolate(std::vector<Vec3f>& offsets, std::vector<double>& weights) {
  const std::size_t used = std::min(offsets.size(), kNearest);
  if (used == 0) return;
  const float support = offsets.size() > used ? length(offsets[used])
                                              : kOpenSupport * length(offsets.back()) + 1e-20f;
  std::vector<float> priors, shares(used);
  for (std::size_t i = 0; i < used; ++i) {
    offsets[i] /= support;
    priors.push_back(maxentPrior(length(offsets[i]), kSharpness));
  }
  if (!(priors[0] > 0)) priors[0] = 1;  // all at one distance
  maxentShares({offsets.data(), used}, priors, shares);
  double sum = 0;
  for (std::size_t i = 0; i < weights.size(); ++i)
    sum += weights[i] *= i < used ? static_cast<double>(shares[i]) : 0;
  for (double& w : weights) w = sum > 0 ? w / sum : 1 / static_cast<double>(weights.size());
}

SeenProbes seenProbes(const Training::Data& data, const ProbeLayout& layout, const Params& params,
                      const LayoutBake& bake, const Receiver& receiver) {
  const QueryModes modes = queryModes(params);
  const auto query = convertQueryParams<float>(queryParams(params));
  const Vec3f from = receiver.position + receiver.normal * (kOffSurface * data.embree.extent());
  std::vector<std::pair<float, std::size_t>> order;
  for (std::size_t p = 0; p < layout.positions.size(); ++p)
    order.emplace_back(length(layout.positions[p] - from), p);
  std::sort(order.begin(), order.end());
  SeenProbes seen;
  std::vector<Vec3f> offsets;
  const std::size_t states = data.stateCount();
  for (const auto& [distance_m, p] : order) {
    if (seen.count == kProbes) break;
    const Vec3f way = layout.positions[p] - from;
    if (distance_m > 0 && data.embree.occluded(Ray{from, 0, way / distance_m,
                                                   distance_m * (1 - kLeftOut)}))
      continue;
    seen.values.resize((seen.count + 1) * states);
    queryValues(modes, bake.plan.irradiance_texels, states,
                readDirection(query, modes, bake.plan.moment_texels, receiver, bake.probes[p]),
                bake.probes[p], &seen.values[seen.count++ * states]);
    offsets.push_back(way);
    seen.prior.push_back(static_cast<double>(queryGain(query, modes, bake.plan.moment_texels,
                                                       receiver, bake.probes[p],
                                                       probeLengths(layout, p).bias)));
  }
  interpolate(offsets, seen.prior);
  return seen;
}

struct States {
  std::vector<std::size_t> fitted, scored;
};

States splitStates(const Training::Data& data) {
  States split;
  bool scored = false;
  for (std::size_t l = 0; l < data.stateCount(); ++l) {
    if (!(data.power[l] > 0)) continue;
    (scored ? split.scored : split.fitted).push_back(l);
    scored = !scored;
  }
  return split;
}

// Sum over states of the products of two probes' errors.
std::vector<double> errorProducts(const Training::Data& data, bool squared, const SeenProbes& seen,
                                  std::size_t receiver, std::span<const std::size_t> states) {
  std::vector<double> g(seen.count * seen.count, 0.0), error(seen.count);
  for (const std::size_t l : states) {
    const auto truth = static_cast<double>(data.truth[receiver * data.stateCount() + l]);
    const double right = squared ? std::sqrt(truth) : truth;
    const double slope_sq = squared ? 4 * (truth + kDim * data.mean[l]) : 1;
    for (std::size_t i = 0; i < seen.count; ++i)
      error[i] = static_cast<double>(seen.values[i * data.stateCount() + l]) - right;
    for (std::size_t i = 0; i < seen.count; ++i)
      for (std::size_t j = 0; j < seen.count; ++j)
        g[i * seen.count + j] += slope_sq * error[i] * error[j] / data.power[l];
  }
  return g;
}

// nrmse over `scored`, root mean square, of weights fitted under `fitted`; the best of all pulls.
// What the fit sums over states is the same for every pull.
double bestWeights(const Training::Data& data, bool squared, std::span<const SeenProbes> seen,
                   std::span<const float> estimates, std::span<const std::size_t> fitted,
                   std::span<const std::size_t> scored) {
  std::vector<std::vector<double>> products(seen.size());
  parallelFor(seen.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r)
      products[r] = errorProducts(data, squared, seen[r], r, fitted);
  });
  double best = std::numeric_limits<double>::infinity();
  for (const double pull : kPulls) {
    std::vector<float> answers(estimates.begin(), estimates.end());
    parallelFor(seen.size(), 16, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) {
        if (seen[r].count == 0) continue;  // the layout's own answer
        const std::vector<double>& g = products[r];
        double diagonal = 0;
        for (std::size_t i = 0; i < seen[r].count; ++i) diagonal += g[i * (seen[r].count + 1)];
        const std::vector<double> w =
            simplexMinimum(g, seen[r].prior, pull * diagonal / static_cast<double>(seen[r].count));
        for (const std::size_t l : scored) {
          double sum = 0;
          for (std::size_t i = 0; i < seen[r].count; ++i)
            sum += w[i] * static_cast<double>(seen[r].values[i * data.stateCount() + l]);
          answers[r * data.stateCount() + l] = static_cast<float>(squared ? sum * sum : sum);
        }
      }
    });
    const std::vector<double> errors = squaredErrors(data, answers);
    double sum = 0;
    for (const std::size_t l : scored) sum += errors[l];
    best = std::min(best, std::sqrt(sum / static_cast<double>(scored.size())));
  }
  return best;
}

}  // namespace

// Mass goes from the weight that costs most to the one that costs least, as much as pays.
std::vector<double> simplexMinimum(std::span<const double> g, std::span<const double> prior,
                                   double pull) {
  const std::size_t n = prior.size();
  std::vector<double> w(prior.begin(), prior.end()), slope(n, 0.0);
  double diagonal = 0;
  for (std::size_t i = 0; i < n; ++i) {
    diagonal += g[i * n + i] / static_cast<double>(n);
    for (std::size_t j = 0; j < n; ++j) slope[i] += g[i * n + j] * w[j];
  }
  for (int step = 0; step < kSteps; ++step) {
    std::size_t to = 0, from = n;
    for (std::size_t i = 0; i < n; ++i) {
      if (slope[i] < slope[to]) to = i;
      if (w[i] > 0 && (from == n || slope[i] > slope[from])) from = i;
    }
    const double gain = from < n ? slope[from] - slope[to] : 0;
    const double curvature =
        from < n ? g[from * n + from] + g[to * n + to] - 2 * g[from * n + to] + 2 * pull : 0;
    if (!(gain > 1e-3 * diagonal) || !(curvature > 0)) break;
    const double mass = std::min(w[from], gain / curvature);
    w[from] -= mass, w[to] += mass;
    for (std::size_t i = 0; i < n; ++i) slope[i] += mass * (g[i * n + to] - g[i * n + from]);
    slope[to] += mass * pull, slope[from] -= mass * pull;
  }
  return w;
}

std::optional<ReadingBound> boundReading(const Training::Data& data, const ProbeLayout& layout,
                                         const Params& params, const LayoutBake& bake,
                                         std::span<const float> estimates) {
  const States states = splitStates(data);
  if (states.scored.empty()) return std::nullopt;
  std::vector<SeenProbes> seen(data.receivers.size());
  parallelFor(seen.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r)
      seen[r] = seenProbes(data, layout, params, bake, data.receivers[r]);
  });
  const bool squared = queryModes(params).average != PL_AVERAGE_LINEAR;
  ReadingBound bound;
  const std::vector<double> errors = squaredErrors(data, estimates);
  for (const std::size_t l : states.scored)
    bound.nrmse += errors[l] / static_cast<double>(states.scored.size());
  bound.nrmse = std::sqrt(bound.nrmse);
  bound.unseen = bestWeights(data, squared, seen, estimates, states.fitted, states.scored);
  bound.seen = bestWeights(data, squared, seen, estimates, states.scored, states.scored);
  return bound;
}

}  // namespace probelab
