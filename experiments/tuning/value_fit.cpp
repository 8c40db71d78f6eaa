// SPDX-License-Identifier: GPL-3.0-or-later
#include "tuning/value_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "bounded_solve.h"
#include "field_view.h"
#include "texel_rows.h"

namespace probelab {
namespace {

constexpr int kMaxLinearisations = 30;
constexpr int kMaxHalvings = 8;
constexpr double kSettled = 1e-4;       // relative fall of the cost by a linearisation
constexpr double kSmallestGain = 0.01;  // where the slope by a texel of 0 is infinite
constexpr double kDarkest = 1e-6;       // of the mean texel; darker ones stay: no gain is known
constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr uint32_t kFixed = 0xffffffffu;

using Rows = std::vector<std::array<TexelRow, 3>>;
using Vector = std::vector<double>;

struct FitPoints {
  std::vector<QueryPoint> points;
  std::vector<Vec3d> a, b;
  Vector weight;  // sums to 1
  double truth(std::size_t i, std::size_t channel) const {
    return (a[i][channel] + b[i][channel]) / 2;
  }
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

// Of what the rows' query answers, luminance.
double nrmseOf(const FitPoints& fit, const Rows& rows) {
  double error = 0, power = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double e =
        luminance(Vec3d(rows[i][0].irradiance, rows[i][1].irradiance, rows[i][2].irradiance));
    const double a = luminance(fit.a[i]), b = luminance(fit.b[i]);
    error += fit.weight[i] * (e - a) * (e - b);
    power += fit.weight[i] * a * b;
  }
  return power > 0 ? std::sqrt(std::max(0.0, error / power)) : 0;
}

// The texels that may move, and where they are stored.
class Unknowns {
 public:
  // All interior texels of the probes that red reads; the other channels read the same.
  Unknowns(const FieldSnapshot& field, const Rows& rows)
      : interior_(interiorTexels(field.lattice.irradiance_texels, field.lattice.border)),
        side_(field.lattice.irradiance_texels),
        of_probe_(field.positions.size(), kFixed) {
    for (const auto& row : rows)
      for (const TexelSlope& s : row[0].slopes) of_probe_[s.texel / perProbe()] = 0;
    for (uint32_t& first : of_probe_)
      if (first != kFixed) first = count_, count_ += perProbe();
  }

  std::size_t count() const { return count_; }
  // An interior texel's unknown; only of a probe that is read.
  uint32_t of(uint32_t texel) const { return of_probe_[texel / perProbe()] + texel % perProbe(); }

  // Calls act(stored texel, unknown), for border texels too.
  template <class Act>
  void forEachStored(const Act& act) const {
    for (std::size_t p = 0; p < of_probe_.size(); ++p)
      for (std::size_t k = 0; of_probe_[p] != kFixed && k < interior_.size(); ++k)
        act(p * interior_.size() + k, of_probe_[p] + static_cast<uint32_t>(interior_[k]));
  }

  // Texels side by side in a map, each pair once.
  std::vector<std::pair<uint32_t, uint32_t>> neighbours() const {
    std::vector<std::pair<uint32_t, uint32_t>> pairs;
    for (const uint32_t first : of_probe_)
      for (int i = 0; first != kFixed && i < side_ * side_; ++i)
        for (const auto& [dx, dy] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
          const int j = tileTexel(i % side_ + dx, i / side_ + dy, side_, 0);
          if (i < j)
            pairs.emplace_back(first + static_cast<uint32_t>(i), first + static_cast<uint32_t>(j));
        }
    return pairs;
  }

 private:
  uint32_t perProbe() const { return static_cast<uint32_t>(side_ * side_); }
  std::vector<int> interior_;
  int side_;
  std::vector<uint32_t> of_probe_;  // first unknown
  uint32_t count_ = 0;
};

// One channel; its unknowns are the relative deviations d.
struct ChannelFit {
  std::size_t channel = 0;
  double power = 0;
  Vector traced, scale;  // [unknown]: stored value = traced + scale * d
  Vector d;
  BoundedProblem problem;
  int iterations = 0;
};

class ValueFitter {
 public:
  ValueFitter(const FieldSnapshot& field, const FitPoints& fit, const Params& params,
              const ValueFitSettings& settings)
      : field_(field),
        fit_(fit),
        params_(params),
        settings_(settings),
        linear_(params.average == PL_AVERAGE_LINEAR && params.encoding_gamma == 1),
        stored_(field.irradiance),
        rows_(texelRows(field, stored_, params, fit.points)),
        unknowns_(field, rows_) {
    for (std::size_t c = 0; c < 3; ++c) startChannel(c);
  }

  ValueFit run();

 private:
  void startChannel(std::size_t channel);
  Vector solveLinear(ChannelFit& fit) const;
  double cost(const std::array<Vector, 3>& d, const Rows& rows) const;
  std::vector<Vec3f> texelsOf(const std::array<Vector, 3>& d) const;
  bool improve();

  const FieldSnapshot& field_;
  const FitPoints& fit_;
  const Params& params_;
  const ValueFitSettings& settings_;
  bool linear_;
  std::vector<Vec3f> stored_;
  Rows rows_;  // of `stored_`
  Unknowns unknowns_;
  std::array<ChannelFit, 3> channels_;
};

void ValueFitter::startChannel(std::size_t channel) {
  ChannelFit& fit = channels_[channel];
  fit.channel = channel;
  double squares = 0;
  for (std::size_t i = 0; i < fit_.points.size(); ++i) {
    fit.power += fit_.weight[i] * fit_.a[i][channel] * fit_.b[i][channel];
    squares += fit_.weight[i] * fit_.weight[i];
  }
  const std::size_t n = unknowns_.count();
  fit.traced.resize(n);
  unknowns_.forEachStored([&](std::size_t stored, uint32_t k) {
    fit.traced[k] = static_cast<double>(field_.irradiance[stored][channel]);
  });
  double mean = 0;
  for (const double t : fit.traced) mean += t / static_cast<double>(n);
  fit.d.assign(n, 0);
  BoundedProblem& p = fit.problem;
  p.unknowns = n;
  p.pull = settings_.pull * squares;
  p.smooth = settings_.smoothness * squares;
  p.pairs = unknowns_.neighbours();
  for (const double t : fit.traced) {
    const bool moves = t > kDarkest * mean;
    const double scale = moves ? (t + settings_.floor * mean) / params_.encoding_gamma : 0;
    fit.scale.push_back(scale);
    p.low.push_back(moves ? ((linear_ ? 0 : kSmallestGain) - 1) * t / scale : -kUnbounded);
  }
}

// The deviations that are best with the slopes of `rows_`.
Vector ValueFitter::solveLinear(ChannelFit& fit) const {
  BoundedProblem& p = fit.problem;
  p.row_begin.assign(1, 0);
  p.columns.clear(), p.values.clear(), p.b.clear();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const TexelRow& row = rows_[i][fit.channel];
    const double factor = std::sqrt(fit_.weight[i] / fit.power);
    double b = fit_.truth(i, fit.channel) - row.irradiance;
    for (const TexelSlope& s : row.slopes) {
      const uint32_t k = unknowns_.of(s.texel);
      const double slope = s.slope * fit.scale[k];
      p.columns.push_back(k);
      p.values.push_back(slope * factor);
      b += slope * fit.d[k];
    }
    p.b.push_back(b * factor);
    p.row_begin.push_back(static_cast<uint32_t>(p.columns.size()));
  }
  BoundedSolution solution = solveBounded(p, fit.d, settings_.iterations);
  fit.iterations += solution.iterations;
  return std::move(solution.x);
}

double ValueFitter::cost(const std::array<Vector, 3>& d, const Rows& rows) const {
  double cost = 0;
  for (const ChannelFit& fit : channels_) {
    if (!(fit.power > 0)) continue;
    const Vector& x = d[fit.channel];
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double error = rows[i][fit.channel].irradiance - fit_.truth(i, fit.channel);
      cost += fit_.weight[i] * error * error / fit.power;
    }
    for (const double v : x) cost += fit.problem.pull * v * v;
    for (const auto& [i, j] : fit.problem.pairs)
      cost += fit.problem.smooth * (x[i] - x[j]) * (x[i] - x[j]);
  }
  return cost;
}

std::vector<Vec3f> ValueFitter::texelsOf(const std::array<Vector, 3>& d) const {
  std::vector<Vec3f> stored = field_.irradiance;
  unknowns_.forEachStored([&](std::size_t i, uint32_t k) {
    for (const ChannelFit& fit : channels_) {
      if (!(fit.power > 0)) continue;
      const double value = fit.traced[k] + fit.scale[k] * d[fit.channel][k];
      stored[i][fit.channel] = static_cast<float>(std::max(0.0, value));
    }
  });
  return stored;
}

// One linearisation; false when the cost has settled. The step is halved until the cost falls.
bool ValueFitter::improve() {
  std::array<Vector, 3> from, to;
  parallelFor(3, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c) {
      from[c] = channels_[c].d;
      to[c] = channels_[c].power > 0 ? solveLinear(channels_[c]) : from[c];
    }
  });
  const double before = cost(from, rows_);
  for (int halvings = 0; halvings < kMaxHalvings; ++halvings) {
    std::vector<Vec3f> stored = texelsOf(to);
    Rows rows = texelRows(field_, stored, params_, fit_.points);
    const double after = cost(to, rows);
    if (after <= before) {
      for (std::size_t c = 0; c < 3; ++c) channels_[c].d = to[c];
      stored_ = std::move(stored);
      rows_ = std::move(rows);
      return before - after > kSettled * before;
    }
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t k = 0; k < to[c].size(); ++k) to[c][k] = (from[c][k] + to[c][k]) / 2;
  }
  return false;
}

ValueFit ValueFitter::run() {
  ValueFit result;
  result.texels = unknowns_.count();
  result.train_before = nrmseOf(fit_, rows_);
  const int most = linear_ ? 1 : kMaxLinearisations;
  for (bool on = true; on && result.linearisations < most; ++result.linearisations) on = improve();
  result.train_after = nrmseOf(fit_, rows_);
  for (const ChannelFit& fit : channels_)
    result.iterations = std::max(result.iterations, fit.iterations);
  result.irradiance = std::move(stored_);
  return result;
}

}  // namespace

ValueFit fitValues(const FieldSnapshot& field, const Receivers& receivers, Split split,
                   const Params& params, const ValueFitSettings& settings) {
  if (!(settings.pull > 0 && settings.smoothness >= 0 && settings.floor >= 0 &&
        std::isfinite(settings.pull + settings.smoothness + settings.floor) &&
        settings.iterations > 0))
    throwInput(
        "values: the pull {} and the iterations {} must be above 0, smoothness {} and floor {} at "
        "least 0",
        settings.pull, settings.iterations, settings.smoothness, settings.floor);
  const FitPoints points = fitPoints(receivers, split);
  const bool lit = std::any_of(points.a.begin(), points.a.end(),
                               [](const Vec3d& a) { return maxComponent(a) > 0; });
  if (!lit)
    throwInput("{}: none of the receivers that values are fitted to gets light in state {}",
               receivers.scene_path, receivers.state);
  return ValueFitter(field, points, params, settings).run();
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
