// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include "base/error.h"
#include "base/interrupt.h"
#include "tuning/solve.h"

namespace probelab {
BiasMap scanBiases(const TuneObjective& objective, const Params& params, int count,
                   double normal_high, double view_high,
                   const std::function<void(double)>& progress) {
  PROBELAB_CHECK(count >= 2);
  BiasMap map{count, normal_high, view_high, {}, {}, {}};
  double weights = 0;
  for (const FrozenState& state : objective.states) weights += state.weight;
  for (int v = 0; v < count; ++v) {
    throwIfInterrupted();
    for (int n = 0; n < count; ++n) {
      Params at = params;
      at.normal_bias = normal_high * n / (count - 1);
      at.view_bias = view_high * v / (count - 1);
      const ParamsScore score = scoreParams(objective, at);
      double square = 0, leak = 0;
      for (std::size_t s = 0; s < score.errors.size(); ++s) {
        const double share = objective.states[s].weight / weights;
        square += share * score.errors[s].nrmse * score.errors[s].nrmse;
        leak += share * score.errors[s].light_leak;
      }
      map.cost.push_back(score.cost);
      map.nrmse.push_back(std::sqrt(square));
      map.light_leak.push_back(leak);
    }
    if (progress) progress(static_cast<double>(v + 1) / count);
  }
  return map;
}

}  // namespace probelab
