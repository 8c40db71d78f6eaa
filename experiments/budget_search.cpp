// SPDX-License-Identifier: GPL-3.0-or-later
#include "budget_search.h"

#include <algorithm>

namespace probelab {
namespace {

constexpr int kFirstBudget = 8;
constexpr double kTolerance = 0.05;

}  // namespace

BudgetSearch searchBudget(double wanted, int limit,
                          const std::function<std::optional<double>(int)>& error) {
  BudgetSearch search;
  const auto meets = [&](int probes) {
    search.steps.push_back({probes, error(probes)});
    const std::optional<double>& found = search.steps.back().error;
    return found && *found <= wanted;
  };
  int low = 0, high = std::min(kFirstBudget, limit);  // low does not meet it, high is tried next
  while (!(search.met = meets(high)) && high < limit) {
    low = high;
    high = high > limit / 2 ? limit : 2 * high;
  }
  if (!search.met) {
    std::optional<double> least;
    for (const BudgetStep& step : search.steps)
      if (step.error && (!least || *step.error < *least))
        least = step.error, search.probes = step.probes;
    return search;
  }
  while (high - low > std::max(1.0, kTolerance * high)) {
    const int middle = low + (high - low) / 2;
    (meets(middle) ? high : low) = middle;
  }
  search.probes = high;
  return search;
}

}  // namespace probelab
