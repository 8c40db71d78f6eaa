// SPDX-License-Identifier: GPL-3.0-or-later
// How much of a solution to believe: cross-validation of the step from the parameters before to the
// solution. Points are in folds; for each fold the problem is solved anew on the other points, and
// shares of that step are judged on the fold's own, which had no part in it.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "tuning/objective.h"

namespace probelab {

inline constexpr double kStepShares[] = {0, 0.25, 0.5, 0.75, 1};

struct StepCheck {
  int folds = 0;              // that had points on both sides; 0: there was nothing to check
  std::vector<double> costs;  // [kStepShares], sum over the folds of the cost of their own points
  double share = 1;           // that cost least; of equal ones the largest
};

// `params` with a share of the way from `from` to `to` in the keys' coordinates, 0 and 1 exactly.
Params partOfStep(std::span<const TunedKey> keys, const Params& from, const Params& to,
                  double share);

// `fold_of` is [state][point], -1: in every problem and judged in none. `solve` returns the
// parameters that it finds from `objective.base`; it is asked once a fold. The check starts from
// `objective.base` too.
StepCheck checkStep(const TuneObjective& objective, const std::vector<std::vector<int>>& fold_of,
                    int folds, const std::function<Params(const TuneObjective&)>& solve);

}  // namespace probelab
