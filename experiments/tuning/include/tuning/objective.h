// SPDX-License-Identifier: GPL-3.0-or-later
// The cost of query parameters over frozen states, as a sum of squares with analytic derivatives:
// the shared query runs on ceres::Jet.
//
//   cost = sum over states s of weight_s / (sum of weights) * (
//            sum over points a rho(E - R) / power
//            + leak * sum over dark points a u^2 / (u + 1e-3)
//            + shadow * sum over the other points a v^2 / (v + 1e-3))
//
// with rho the square, or a robust loss that grows linearly beyond `robust` times the root of
// `power`, u = max(0, E - R - 2 sigma) / mean and v = max(0, R - E - 2 sigma) / mean. Up to
// FrozenState::noise, a constant, the first term is nrmse^2; the second is light_leak but for leaks
// below 1e-3 of the mean, where it is quadratic; the third is shadow_leak in the same way. Squares
// of u see no leak of that size unless they are weighted so much that a few large ones rule.
//
// The cost is continuous but for jumps of the size of trilinear_floor^3 and where the nearest probe
// takes over, and its derivative jumps: a biased point enters another cell or voxel, the direction
// to a probe another texel, a weight passes the crush's threshold. Derivatives are those of the
// piece that the point is in.
#pragma once

#include <span>
#include <vector>

#include "tuning/frozen_state.h"
#include "tuning/tuned_keys.h"

namespace probelab {

// Plain squares are the default because robust losses from 0.1 to 1 moved held-out nrmse by -1.6 to
// +4.1 % without a pattern (grids of 256 probes, preset rtxgi in sun_room, thin_wall/scene_05cm and
// cornell, probelab in sun_room; measured while the leak term was a plain square of weight 1).
struct ObjectiveSettings {
  // Weight of the light leaks' term. At 3, grids of 256 probes leaked 1.5 times as much as the best
  // published preset under lights that were not tuned on (geometric mean of nine scenes), at 30 less
  // than half as much; held-out nrmse rose by 2 % (one seed, scripts/tuning.py).
  double leak = 30;
  // Weight of the shadow leaks' term. Off: 0.1 and 0.4 lowered held-out shadow leak of
  // thin_wall/scene_05cm (grid of 256 probes, 1,024 receivers, one seed) by 7 and 10 % and raised its
  // nrmse by 2 and 6 %. Without it the leak is below that of rtxgi and gdc2019 and above that of
  // majercik2021.
  double shadow = 0;
  double robust = 0;  // 0: plain squares
};

struct TuneObjective {
  std::span<const FrozenState> states;
  std::span<const TunedKey> keys;  // of tunedKeys, 1 to 9
  Params base;                     // values of everything that is not a key
  ObjectiveSettings settings;
};

std::size_t residualCount(const TuneObjective& objective);

// Residuals at coordinates x in [0, 1], [residual]; their squares sum to the cost. Where `jacobian`
// is not empty, [residual][key] by x. Parallel; the same bits whatever the number of threads.
// Throws NumericalError where one is not finite.
void evaluateResiduals(const TuneObjective& objective, std::span<const double> x,
                       std::span<double> residuals, std::span<double> jacobian = {});
double evaluateCost(const TuneObjective& objective, std::span<const double> x);

// Irradiance (luminance) at the state's points under `params`.
std::vector<double> queryPoints(const FrozenState& state, const Params& params);

// Of one state at parameters, by the definitions of the metrics over its points.
struct FrozenErrors {
  double nrmse = 0, light_leak = 0, shadow_leak = 0;
};
FrozenErrors frozenErrors(const FrozenState& state, const Params& params);

// The objective's cost at any parameters, and the errors of each of its states. Modes and the
// atlases' encoding are those of the states' fields, whatever `params` says.
struct ParamsScore {
  double cost = 0;
  std::vector<FrozenErrors> errors;
};
ParamsScore scoreParams(const TuneObjective& objective, const Params& params);

}  // namespace probelab
