// SPDX-License-Identifier: GPL-3.0-or-later
#include "tuning/value_fit.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "bounded_solve.h"
#include "field_view.h"
#include "texel_rows.h"

namespace probelab {
namespace {

constexpr int kMaxLinearisations = 12;
constexpr int kMaxHalvings = 6;
constexpr double kSettled = 1e-4;      // relative fall of the cost
constexpr double kSmallestGain = 0.01;  // where a root is taken of the texel

struct FitPoints {
  std::vector<QueryPoint> points;
  std::vector<Vec3d> a, b;
  std::vector<double> weight;  // sums to 1
  Vec3d truth(std::size_t i) const { return (a[i] + b[i]) * 0.5; }
};

FitPoints fitPoints(const Receivers& receivers, Split split) {
  FitPoints fit;
  double sum = 0;
  for (const Receiver& r : receivers.points) {
    if (r.split != split) continue;
    fit.points.push_back({r.position, r.normal, r.view});
    fit.a.push_back(Vec3d(r.a)), fit.b.push_back(Vec3d(r.b));
    fit.weight.push_back(r.area);
    sum += r.area;
  }
  if (!(sum > 0))
    throwInput("{}: no receiver is in the part that values are fitted to; take more of them",
               receivers.scene_path);
  for (double& w : fit.weight) w /= sum;
  return fit;
}

double powerOf(const FitPoints& fit, std::size_t channel) {
  double power = 0;
  for (std::size_t i = 0; i < fit.points.size(); ++i)
    power += fit.weight[i] * fit.a[i][channel] * fit.b[i][channel];
  return power;
}

double nrmseOf(const FieldSnapshot& field, std::span<const Vec3f> stored, const Params& params,
               const FitPoints& fit) {
  struct StoredView : FieldView {
    std::span<const Vec3f> stored;
    std::size_t per_probe;
    const Vec3f& fetchIrradiance(int probe, int texel) const {
      return stored[static_cast<std::size_t>(probe) * per_probe + static_cast<std::size_t>(texel)];
    }
  };
  const StoredView view{{field}, stored, stored.size() / field.positions.size()};
  const QueryModes modes = viewModes(field, params);
  const QueryParams<double> query = queryParams(params);
  double error = 0, power = 0;
  for (std::size_t i = 0; i < fit.points.size(); ++i) {
    const double e = luminance(queryView(view, query, modes, fit.points[i]).irradiance);
    const double a = luminance(fit.a[i]), b = luminance(fit.b[i]);
    error += fit.weight[i] * (e - a) * (e - b);
    power += fit.weight[i] * a * b;
  }
  return std::sqrt(std::max(0.0, error / power));
}

// What the channels share.
struct FitSetup {
  const Params& params;
  const ValueFitSettings& settings;
  const FitPoints& fit;
  std::vector<uint32_t> texel;     // [unknown]: interior texel of the field
  std::vector<uint32_t> unknown;   // [interior texel], kNone: not read
  std::vector<std::pair<uint32_t, uint32_t>> pairs;  // of unknowns, neighbours
  double prior = 0;                // sum of squares of the weights
  bool linear = true;
};
constexpr uint32_t kNone = 0xffffffffu;

using Rows = std::vector<std::array<TexelRow, 3>>;

void findUnknowns(FitSetup& setup, const Rows& rows, const FieldSnapshot& field) {
  const int n = field.lattice.irradiance_texels;
  const auto per_probe = static_cast<uint32_t>(n * n);
  setup.unknown.assign(field.positions.size() * per_probe, kNone);
  for (const auto& row : rows)
    for (const TexelSlope& s : row[0].slopes) setup.unknown[s.texel] = 0;
  if (setup.settings.extend)
    for (uint32_t p = 0; p < field.positions.size(); ++p) {
      bool any = false;
      for (uint32_t k = 0; k < per_probe; ++k) any = any || setup.unknown[p * per_probe + k] == 0;
      for (uint32_t k = 0; any && k < per_probe; ++k) setup.unknown[p * per_probe + k] = 0;
    }
  for (uint32_t t = 0; t < setup.unknown.size(); ++t) {
    if (setup.unknown[t] == kNone) continue;
    setup.unknown[t] = static_cast<uint32_t>(setup.texel.size());
    setup.texel.push_back(t);
  }
  for (uint32_t p = 0; p < field.positions.size(); ++p)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x)
        for (const auto& [dx, dy] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
          const auto i = static_cast<uint32_t>(y * n + x);
          const auto j = static_cast<uint32_t>(tileTexel(x + dx, y + dy, n, 0));
          const uint32_t a = setup.unknown[p * per_probe + i], b = setup.unknown[p * per_probe + j];
          if (i < j && a != kNone && b != kNone) setup.pairs.emplace_back(a, b);
        }
}

// One channel: the problem in relative deviations d around those of the last linearisation.
struct ChannelFit {
  std::size_t channel = 0;
  double power = 0;
  Vec3d unused;
  std::vector<double> traced, scale;  // [unknown], stored values; scale of d
  std::vector<double> d;              // [unknown]
  BoundedProblem problem;
  int iterations = 0;
  double value(std::size_t k) const { return traced[k] + scale[k] * d[k]; }
};

ChannelFit startChannel(const FitSetup& setup, std::size_t channel,
                        std::span<const double> traced) {
  ChannelFit fit;
  fit.channel = channel;
  fit.power = powerOf(setup.fit, channel);
  fit.traced.assign(traced.begin(), traced.end());
  double mean = 0;
  for (const double t : traced) mean += t / static_cast<double>(traced.size());
  const double gamma = setup.params.encoding_gamma;
  for (const double t : traced)
    fit.scale.push_back((t + setup.settings.floor * mean) / gamma);
  fit.d.assign(traced.size(), 0);
  fit.problem.unknowns = traced.size();
  fit.problem.pull = setup.settings.pull * setup.prior;
  fit.problem.smooth = setup.settings.smoothness * setup.prior;
  fit.problem.pairs = setup.pairs;
  for (std::size_t k = 0; k < traced.size(); ++k) {
    const double least = setup.linear ? 0 : kSmallestGain * traced[k];
    fit.problem.low.push_back(fit.scale[k] > 0 ? (least - traced[k]) / fit.scale[k] : 0);
  }
  return fit;
}

double costOf(const FitSetup& setup, const ChannelFit& fit, const std::vector<double>& d,
              const Rows& rows) {
  double cost = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double error = rows[i][fit.channel].irradiance - setup.fit.truth(i)[fit.channel];
    cost += setup.fit.weight[i] * error * error / fit.power;
  }
  for (const double v : d) cost += fit.problem.pull * v * v;
  for (const auto& [i, j] : setup.pairs)
    cost += fit.problem.smooth * (d[i] - d[j]) * (d[i] - d[j]);
  return cost;
}

// Solves the problem with the query's slopes of `rows`; returns the new deviations.
std::vector<double> linearStep(const FitSetup& setup, ChannelFit& fit, const Rows& rows) {
  BoundedProblem& p = fit.problem;
  p.row_begin.assign(1, 0);
  p.columns.clear(), p.values.clear(), p.b.clear();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const TexelRow& row = rows[i][fit.channel];
    const double factor = std::sqrt(setup.fit.weight[i] / fit.power);
    double b = setup.fit.truth(i)[fit.channel] - row.irradiance;
    for (const TexelSlope& s : row.slopes) {
      const uint32_t k = setup.unknown[s.texel];
      const double slope = s.slope * fit.scale[k];
      p.columns.push_back(k);
      p.values.push_back(slope * factor);
      b += slope * fit.d[k];
    }
    p.b.push_back(b * factor);
    p.row_begin.push_back(static_cast<uint32_t>(p.columns.size()));
  }
  BoundedSolution solution = solveBounded(p, fit.d, setup.settings.iterations);
  fit.iterations += solution.iterations;
  return std::move(solution.x);
}

}  // namespace

ValueFit fitValues(const FieldSnapshot& field, const Receivers& receivers, Split split,
                   const Params& params, const ValueFitSettings& settings) {
  const FitPoints points = fitPoints(receivers, split);
  FitSetup setup{params, settings, points, {}, {}, {}};
  for (const double w : points.weight) setup.prior += w * w;
  setup.linear = params.average == PL_AVERAGE_LINEAR && params.encoding_gamma == 1;
  ValueFit result;
  result.irradiance = field.irradiance;
  Rows rows = texelRows(field, result.irradiance, params, points.points);
  findUnknowns(setup, rows, field);
  result.texels = setup.texel.size();

  const std::vector<int> interior = interiorTexels(field.lattice);
  const int n = field.lattice.irradiance_texels, border = field.lattice.border;
  const auto per_probe = static_cast<uint32_t>(n * n);
  const auto stored_place = [&](uint32_t texel) {
    const uint32_t k = texel % per_probe;
    return texel / per_probe * interior.size() +
           static_cast<std::size_t>(tileTexel(static_cast<int>(k) % n, static_cast<int>(k) / n, n,
                                              border));
  };
  std::vector<ChannelFit> fits;
  for (std::size_t c = 0; c < 3; ++c) {
    std::vector<double> traced;
    for (const uint32_t t : setup.texel)
      traced.push_back(static_cast<double>(field.irradiance[stored_place(t)][c]));
    fits.push_back(startChannel(setup, c, traced));
  }
  if (std::none_of(fits.begin(), fits.end(), [](const ChannelFit& f) { return f.power > 0; }))
    throwInput("{}: none of the receivers that values are fitted to gets light",
               receivers.scene_path);

  // Texels of the deviations `d`, [channel][unknown].
  const auto texelsOf = [&](const std::array<std::vector<double>, 3>& d) {
    std::vector<Vec3f> stored = result.irradiance;
    std::vector<Vec3f> inner(field.positions.size() * per_probe);
    for (std::size_t i = 0; i < stored.size(); ++i) {
      const std::size_t probe = i / interior.size();
      const uint32_t t = static_cast<uint32_t>(probe * per_probe +
                                               static_cast<std::size_t>(interior[i % interior.size()]));
      const uint32_t k = setup.unknown[t];
      if (k == kNone) continue;
      for (std::size_t c = 0; c < 3; ++c)
        stored[i][c] = static_cast<float>(
            std::max(0.0, fits[c].traced[k] + fits[c].scale[k] * d[c][k]));
    }
    return stored;
  };
  result.train_before = nrmseOf(field, result.irradiance, params, points);
  for (; result.linearisations < (setup.linear ? 1 : kMaxLinearisations);) {
    ++result.linearisations;
    std::array<std::vector<double>, 3> wanted, d;
    parallelFor(3, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t c = begin; c < end; ++c)
        wanted[c] = fits[c].power > 0 ? linearStep(setup, fits[c], rows) : fits[c].d;
    });
    double before = 0, after = 0;
    for (const ChannelFit& f : fits)
      if (f.power > 0) before += costOf(setup, f, f.d, rows);
    double share = 1;
    std::vector<Vec3f> stored;
    Rows next;
    for (int k = 0; k < kMaxHalvings; ++k, share /= 2) {
      for (std::size_t c = 0; c < 3; ++c) {
        d[c] = fits[c].d;
        for (std::size_t i = 0; i < d[c].size(); ++i) d[c][i] += share * (wanted[c][i] - d[c][i]);
      }
      stored = texelsOf(d);
      next = texelRows(field, stored, params, points.points);
      after = 0;
      for (const ChannelFit& f : fits)
        if (f.power > 0) after += costOf(setup, f, d[f.channel], next);
      if (after <= before) break;
    }
    if (after > before) break;
    for (std::size_t c = 0; c < 3; ++c) fits[c].d = d[c];
    result.irradiance = stored;
    rows = std::move(next);
    if (before - after <= kSettled * before) break;
  }
  for (const ChannelFit& f : fits) result.iterations = std::max(result.iterations, f.iterations);
  result.train_after = nrmseOf(field, result.irradiance, params, points);
  return result;
}

std::vector<Vec3f> transferGains(const std::vector<Vec3f>& traced, const std::vector<Vec3f>& fitted,
                                 const std::vector<Vec3f>& other) {
  PROBELAB_CHECK(traced.size() == fitted.size() && traced.size() == other.size());
  std::vector<Vec3f> result = other;
  for (std::size_t i = 0; i < other.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c)
      if (traced[i][c] > 0) result[i][c] = other[i][c] * (fitted[i][c] / traced[i][c]);
  return result;
}

}  // namespace probelab
