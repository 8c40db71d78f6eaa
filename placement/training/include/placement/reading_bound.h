// SPDX-License-Identifier: GPL-3.0-or-later
// What another reading of the same probes could gain: at every receiver weights of its own.
#pragma once

#include <optional>
#include <span>

#include "ddgi/layout.h"
#include "ddgi/params.h"
#include "placement/training_data.h"

namespace probelab {

// Roots of the mean of nrmse^2 over every other state (the second, the fourth ... that is lit).
struct ReadingBound {
  double nrmse = 0;   // the layout's own query
  double unseen = 0;  // weights fitted under the rest of the states
  double seen = 0;    // weights fitted under the very states that they are scored under
};

// At each receiver the 20 nearest probes that it sees have non-negative weights, sum 1, that lower
// the sum over states of d^2 / power plus a pull towards maximum-entropy weights times facing and
// visibility; of some pulls the one that does best where it is scored counts, so both are on the
// kind side. No interpolant knows a receiver's own truth: where `unseen` is no less than `nrmse`,
// interpolation has nothing left to gain under light that it was not made for, and only other
// probes can.
//
// `estimates` are those of estimateLayout on the same bake. None with fewer than two lit states.
std::optional<ReadingBound> boundReading(const Training::Data& data, const ProbeLayout& layout,
                                         const Params& params, const LayoutBake& bake,
                                         std::span<const float> estimates);

// Non-negative w of sum 1 with the least w.G w + pull |w - prior|^2, G [row * n + column] positive
// semidefinite; to a thousandth of G's mean diagonal in the gradient.
std::vector<double> simplexMinimum(std::span<const double> g, std::span<const double> prior,
                                   double pull);

}  // namespace probelab
