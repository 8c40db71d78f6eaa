// SPDX-License-Identifier: GPL-3.0-or-later
#include "jet.h"  // first

#include "tuning/objective.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"

namespace probelab {
namespace {

constexpr std::size_t kMaxKeys = 9;  // every key of the query
constexpr std::size_t kGrain = 64;
constexpr double kLeakKnee = 1e-3;  // of the mean, where a leak's cost turns from square to linear
template <int N>
using Jet = ceres::Jet<double, N>;

template <class T>
T& queryMember(QueryParams<T>& params, double Params::*key) {
  if (key == &Params::normal_bias) return params.normal_bias;
  if (key == &Params::view_bias) return params.view_bias;
  if (key == &Params::facing_offset) return params.facing_offset;
  if (key == &Params::trilinear_floor) return params.trilinear_floor;
  if (key == &Params::chebyshev_power) return params.chebyshev_power;
  if (key == &Params::visibility_floor) return params.visibility_floor;
  if (key == &Params::variance_bias) return params.variance_bias;
  if (key == &Params::crush_threshold) return params.crush_threshold;
  PROBELAB_CHECK(key == &Params::parallax);
  return params.parallax;
}

// `params` for the state's field: what belongs to the atlases is the field's own.
QueryParams<double> paramsFor(const FrozenState& state, const Params& params) {
  QueryParams<double> query = queryParams(params);
  query.decode_exponent = state.field.params.decode_exponent;
  query.variance_floor = state.field.params.variance_floor;
  return query;
}

template <int N>
QueryParams<Jet<N>> jetParams(const TuneObjective& objective, std::span<const double> x,
                              const QueryParams<double>& values) {
  QueryParams<Jet<N>> params = convertQueryParams<Jet<N>>(values);
  for (std::size_t i = 0; i < objective.keys.size(); ++i)
    queryMember(params, objective.keys[i].value).v[static_cast<int>(i)] =
        keySlope(objective.keys[i], x[i]);
  return params;
}

// Factors of a state's residuals.
struct Scales {
  double error = 0;       // of (E - R) sqrt(weight)
  double leak = 0;        // of u sqrt(weight / (u + kLeakKnee)) of dark points
  double shadow = 0;      // of v, likewise, of the others
  double mean = 1;        // of u and v
  double bend = 0;        // |E - R| where the robust loss turns linear; 0: never
  std::size_t first = 0;  // residual
};

// Whether a point has a residual of its leak beside that of its error.
bool hasLeakResidual(const ObjectiveSettings& settings, const TunePoint& point) {
  return (point.dark ? settings.leak : settings.shadow) > 0;
}

std::size_t residualCountOf(const ObjectiveSettings& settings, const FrozenState& state) {
  return state.points.size() +
         static_cast<std::size_t>(std::ranges::count_if(
             state.points, [&](const TunePoint& p) { return hasLeakResidual(settings, p); }));
}

std::vector<Scales> scalesOf(const TuneObjective& objective) {
  const ObjectiveSettings& settings = objective.settings;
  double sum = 0;
  for (const FrozenState& state : objective.states) sum += state.weight;
  std::vector<Scales> scales;
  std::size_t first = 0;
  for (const FrozenState& state : objective.states) {
    const double share = state.weight / sum;
    scales.push_back({std::sqrt(share / state.power), std::sqrt(share * settings.leak),
                      std::sqrt(share * settings.shadow), state.mean,
                      settings.robust * std::sqrt(state.power), first});
    first += residualCountOf(settings, state);
  }
  return scales;
}

// Of one point: values and their derivatives by the estimate.
struct PointResiduals {
  double error = 0, error_slope = 0;
  double leak = 0, leak_slope = 0;
};

PointResiduals pointResiduals(const Scales& scales, const TunePoint& point, double estimate) {
  const double weight = std::sqrt(point.weight), e = estimate - point.truth, size = std::abs(e);
  PointResiduals r{scales.error * weight * e, scales.error * weight, 0, 0};
  if (scales.bend > 0 && size > scales.bend) {
    // rho = 2 bend |e| - bend^2; the residual is its root.
    const double root = std::sqrt(2 * scales.bend * size - scales.bend * scales.bend);
    r.error = scales.error * weight * std::copysign(root, e);
    r.error_slope = scales.error * weight * scales.bend / root;
  }
  const double sign = point.dark ? 1 : -1, scale = point.dark ? scales.leak : scales.shadow;
  const double u = (sign * e - 2 * point.sigma) / scales.mean;
  if (u > 0) {
    const double root = std::sqrt(u + kLeakKnee);
    r.leak = scale * weight * u / root;
    r.leak_slope = sign * scale * weight * (u / 2 + kLeakKnee) / (root * root * root * scales.mean);
  }
  return r;
}

FrozenErrors errorsOf(const FrozenState& state, std::span<const double> estimates) {
  FrozenErrors errors;
  double square = 0;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const TunePoint& p = state.points[i];
    const double e = estimates[i] - p.truth;
    square += p.weight * e * e;
    if (p.dark)
      errors.light_leak += p.weight * std::max(0.0, e - 2 * p.sigma) / state.mean;
    else
      errors.shadow_leak += p.weight * std::max(0.0, -e - 2 * p.sigma) / state.mean;
  }
  errors.nrmse = std::sqrt(std::max(0.0, square / state.power - state.noise));
  return errors;
}

void checkObjective(const TuneObjective& objective) {
  PROBELAB_CHECK(!objective.keys.empty() && objective.keys.size() <= kMaxKeys);
  PROBELAB_CHECK(!objective.states.empty());
}

void checkFinite(std::span<const double> values, const char* what) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i]))
      throw NumericalError(fmt::format("tuning: {} {} is {}", what, i, values[i]));
}

// Estimates at the state's points and their derivatives [point][key].
struct Estimates {
  std::vector<double> values, slopes;
};

std::vector<double> estimateValues(const FrozenState& state, const QueryParams<double>& params) {
  std::vector<double> values(state.points.size());
  parallelFor(values.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      values[i] =
          luminance(querySnapshot<double>(state.field, params, state.points[i].query).irradiance);
  });
  return values;
}

// Flattened (7 times faster): calls between the small functions of the query would take most of its
// time, since each one copies Jets. Not with the sanitizer's checks in every access, which then take
// the compiler ten minutes and more.
#ifdef __SANITIZE_ADDRESS__
#define PROBELAB_FLATTEN
#else
#define PROBELAB_FLATTEN [[gnu::flatten]]
#endif
template <int N>
PROBELAB_FLATTEN Jet<N> estimateWithSlopes(const FieldSnapshot& field,
                                           const QueryParams<Jet<N>>& params,
                                           const QueryPoint& point) {
  return luminance(querySnapshot<Jet<N>>(field, params, point).irradiance);
}

template <int N>
Estimates estimateSlopes(const TuneObjective& objective, std::span<const double> x,
                         const FrozenState& state, const QueryParams<double>& params) {
  const QueryParams<Jet<N>> jets = jetParams<N>(objective, x, params);
  const std::size_t count = state.points.size(), keys = x.size();
  Estimates estimates{std::vector<double>(count), std::vector<double>(count * keys)};
  parallelFor(count, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Jet<N> e = estimateWithSlopes<N>(state.field, jets, state.points[i].query);
      estimates.values[i] = e.a;
      for (std::size_t k = 0; k < keys; ++k)
        estimates.slopes[i * keys + k] = e.v[static_cast<int>(k)];
    }
  });
  return estimates;
}

// By the narrowest of a few widths that holds the keys.
Estimates estimateSlopesOf(const TuneObjective& objective, std::span<const double> x,
                           const FrozenState& state, const QueryParams<double>& params) {
  if (x.size() <= 2) return estimateSlopes<2>(objective, x, state, params);
  if (x.size() <= 6) return estimateSlopes<6>(objective, x, state, params);
  return estimateSlopes<static_cast<int>(kMaxKeys)>(objective, x, state, params);
}

void evaluateState(const TuneObjective& objective, std::span<const double> x,
                   const FrozenState& state, const Scales& scales, std::span<double> residuals,
                   std::span<double> jacobian) {
  Params at = objective.base;
  setCoordinates(objective.keys, x, at);
  const QueryParams<double> params = paramsFor(state, at);
  const bool wanted = !jacobian.empty();
  const Estimates estimates = wanted ? estimateSlopesOf(objective, x, state, params)
                                     : Estimates{estimateValues(state, params), {}};
  const std::size_t keys = x.size();
  std::size_t row = scales.first;
  const auto put = [&](std::size_t point, double residual, double slope) {
    residuals[row] = residual;
    for (std::size_t k = 0; wanted && k < keys; ++k)
      jacobian[row * keys + k] = slope * estimates.slopes[point * keys + k];
    ++row;
  };
  for (std::size_t i = 0; i < state.points.size(); ++i) {
    const TunePoint& point = state.points[i];
    const PointResiduals r = pointResiduals(scales, point, estimates.values[i]);
    put(i, r.error, r.error_slope);
    if (hasLeakResidual(objective.settings, point)) put(i, r.leak, r.leak_slope);
  }
}

}  // namespace

std::size_t residualCount(const TuneObjective& objective) {
  std::size_t count = 0;
  for (const FrozenState& state : objective.states)
    count += residualCountOf(objective.settings, state);
  return count;
}

void evaluateResiduals(const TuneObjective& objective, std::span<const double> x,
                       std::span<double> residuals, std::span<double> jacobian) {
  checkObjective(objective);
  const std::vector<Scales> scales = scalesOf(objective);
  for (std::size_t s = 0; s < objective.states.size(); ++s)
    evaluateState(objective, x, objective.states[s], scales[s], residuals, jacobian);
  checkFinite(residuals, "residual");
  checkFinite(jacobian, "derivative");
}

double evaluateCost(const TuneObjective& objective, std::span<const double> x) {
  std::vector<double> residuals(residualCount(objective));
  evaluateResiduals(objective, x, residuals);
  double cost = 0;
  for (const double r : residuals) cost += r * r;
  return cost;
}

std::vector<double> queryPoints(const FrozenState& state, const Params& params) {
  return estimateValues(state, paramsFor(state, params));
}

FrozenErrors frozenErrors(const FrozenState& state, const Params& params) {
  return errorsOf(state, queryPoints(state, params));
}

ParamsScore scoreParams(const TuneObjective& objective, const Params& params) {
  const std::vector<Scales> scales = scalesOf(objective);
  ParamsScore score;
  for (std::size_t s = 0; s < objective.states.size(); ++s) {
    const FrozenState& state = objective.states[s];
    const std::vector<double> estimates = queryPoints(state, params);
    score.errors.push_back(errorsOf(state, estimates));
    for (std::size_t i = 0; i < estimates.size(); ++i) {
      const PointResiduals r = pointResiduals(scales[s], state.points[i], estimates[i]);
      score.cost += r.error * r.error + r.leak * r.leak;
    }
  }
  return score;
}

}  // namespace probelab
