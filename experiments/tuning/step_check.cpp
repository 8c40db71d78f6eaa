// SPDX-License-Identifier: GPL-3.0-or-later
#include "tuning/step_check.h"

#include <algorithm>
#include <iterator>

#include "base/error.h"

namespace probelab {
namespace {

// The states with those points alone that are of the fold, or are not. Powers, means and weights
// stay, so that the costs of the folds add up to the whole's.
std::vector<FrozenState> pointsOf(std::span<const FrozenState> states,
                                  const std::vector<std::vector<int>>& fold_of, int fold,
                                  bool own) {
  std::vector<FrozenState> part(states.begin(), states.end());
  for (std::size_t s = 0; s < part.size(); ++s) {
    PROBELAB_CHECK(fold_of[s].size() == states[s].points.size());
    part[s].points.clear();
    for (std::size_t i = 0; i < fold_of[s].size(); ++i)
      if ((fold_of[s][i] == fold) == own) part[s].points.push_back(states[s].points[i]);
  }
  return part;
}

std::size_t pointCount(std::span<const FrozenState> states) {
  std::size_t count = 0;
  for (const FrozenState& state : states) count += state.points.size();
  return count;
}

}  // namespace

Params partOfStep(std::span<const TunedKey> keys, const Params& from, const Params& to,
                  double share) {
  const std::vector<double> a = toCoordinates(keys, from), b = toCoordinates(keys, to);
  Params params = from;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const double before = from.*keys[i].value, after = to.*keys[i].value;
    double& value = params.*keys[i].value;
    if (share == 1)
      value = after;
    else if (share > 0 && before != after)
      value = keyValue(keys[i], a[i] + share * (b[i] - a[i]));
  }
  return params;
}

StepCheck checkStep(const TuneObjective& objective, const std::vector<std::vector<int>>& fold_of,
                    int folds, double allowance,
                    const std::function<Params(const TuneObjective&)>& solve) {
  PROBELAB_CHECK(fold_of.size() == objective.states.size());
  StepCheck check;
  check.costs.assign(std::size(kStepShares), 0.0);
  for (int fold = 0; fold < folds; ++fold) {
    const std::vector<FrozenState> own = pointsOf(objective.states, fold_of, fold, true);
    if (pointCount(own) == 0) continue;
    Params solved;
    {
      const std::vector<FrozenState> others = pointsOf(objective.states, fold_of, fold, false);
      if (pointCount(others) <= objective.keys.size()) continue;
      TuneObjective problem = objective;
      problem.states = others;
      solved = solve(problem);
    }
    TuneObjective judged = objective;
    judged.states = own;
    std::vector<double>& costs = check.fold_costs.emplace_back();
    for (const double share : kStepShares) {
      const Params tried = partOfStep(objective.keys, objective.base, solved, share);
      costs.push_back(scoreParams(judged, tried).cost);
      check.costs[costs.size() - 1] += costs.back();
    }
    ++check.folds;
  }
  if (check.folds == 0) return check;
  const double least = *std::min_element(check.costs.begin(), check.costs.end());
  const double allowed = (1 + allowance) * least;
  const auto first = std::find_if(check.costs.begin(), check.costs.end(),
                                  [&](double cost) { return cost <= allowed; });
  check.share = kStepShares[first - check.costs.begin()];
  return check;
}

}  // namespace probelab
