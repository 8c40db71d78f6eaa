// SPDX-License-Identifier: GPL-3.0-or-later
// The smallest budget that meets an error: doubling until it does, then bisection to within 5 %.
#pragma once

#include <functional>
#include <optional>
#include <vector>

namespace probelab {

struct BudgetStep {
  int probes = 0;
  std::optional<double> error;  // empty: nothing can be placed with that many
};

struct BudgetSearch {
  std::vector<BudgetStep> steps;  // in the order in which they were taken
  int probes = 0;                 // the smallest that meets it, else the one with the least error
  bool met = false;
};

// `error` of a budget from 1 to `limit`. Errors need not fall with the budget: the answer meets
// `wanted`, and the largest budget below it that was tried and is not within 5 % does not. Not met,
// and 0 probes, where no budget has an error.
BudgetSearch searchBudget(double wanted, int limit,
                          const std::function<std::optional<double>(int)>& error);

}  // namespace probelab
