// SPDX-License-Identifier: GPL-3.0-or-later
// The end of a tune: the last steps over kinks, and what the Jacobian says at the optimum.
#pragma once

#include <functional>
#include <vector>

#include "tuning/solve.h"

namespace probelab {

// Pattern search from `start` along the axes and the Jacobian's singular vectors, with steps from
// 0.08 down to 0.001: a kink stops Levenberg-Marquardt, a wrong derivative on one side does not
// stop this. It holds x to [0, 1] and so reaches the ends, which sigmoids do not. Along a curved
// valley it would creep for ever: it ends after 1,000 evaluations.
SolvePath polishOptimum(const TuneObjective& objective, const SolveStep& start,
                        const std::function<double(const std::vector<double>&)>& cost);

// Fills singular values, deviations, correlation and sensitivity at result.x.
void describeOptimum(const TuneObjective& objective, SolveResult& result);

}  // namespace probelab
