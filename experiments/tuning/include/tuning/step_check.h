// SPDX-License-Identifier: GPL-3.0-or-later
// How much of a solution to believe: cross-validation of the step from the parameters before to the
// solution. Points are in folds; for each fold the problem is solved anew on the other points, and
// shares of that step are judged on the fold's own, which had no part in it.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "tuning/objective.h"

namespace probelab {

inline constexpr double kStepShares[] = {0, 0.25, 0.5, 0.75, 1};

struct StepCheck {
  int folds = 0;  // that were judged: with points of their own and more points than keys outside
  std::vector<std::vector<double>> fold_costs;  // [fold][kStepShares], of its own points
  std::vector<double> costs;                    // [kStepShares], their sum
  double share = 1;  // that is to be taken; 1 where no fold could be judged
};

// `from` with a share of the step to `to` in the keys' coordinates; 0 and 1, and what is equal in
// both, exactly.
Params partOfStep(std::span<const TunedKey> keys, const Params& from, const Params& to,
                  double share);

// The share is the smallest that costs at most (1 + allowance) times the least: what hardly pays on
// points left out may not pay elsewhere. `fold_of` is [state][point], -1: in every problem and
// judged in none. `solve` is asked once a fold and returns the parameters that it finds; steps lead
// there from `objective.base`.
StepCheck checkStep(const TuneObjective& objective, const std::vector<std::vector<int>>& fold_of,
                    int folds, double allowance,
                    const std::function<Params(const TuneObjective&)>& solve);

}  // namespace probelab
