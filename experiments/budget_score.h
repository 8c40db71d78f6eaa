// SPDX-License-Identifier: GPL-3.0-or-later
// The rungs of the error budget scored, as JSON and as a table.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "budget_rungs.h"
#include "evaluation.h"
#include "json.h"

namespace probelab {

struct BudgetRung {
  std::string name, about;
  ErrorReport report;                 // of the mean of both estimates
  std::optional<double> nrmse;        // root of mean_square; of equal estimates the report's
  std::optional<double> mean_square;  // nrmse^2 from both estimates; may be below 0 by noise
  std::optional<double> noise;        // of the paths, as a part of `nrmse` of either estimate alone
};

// Sum a (first - A)(second - B), over both pairings, by sum a A B, luminance: nrmse^2 without the
// noise of the paths or of the truth; with equal estimates the square of ErrorMetrics::nrmse. Empty
// where the truth is black.
std::optional<double> budgetMeanSquare(const RungEstimate& estimate, const Receivers& scored);

// Over receivers that are all scored.
BudgetRung scoreRung(const std::string& name, const std::string& about,
                     const RungEstimate& estimate, const Receivers& scored);

// [{name, about, nrmse, mean_square, noise, bias, light_leak, shadow_leak, smape, share, error}]:
// `share` is the rise of the mean square over the rung before by that of the last rung, so shares
// sum to 1; negative where the new error makes up for an older one.
Json rungsJson(const std::vector<BudgetRung>& rungs);
std::string formatRungs(const Json& rungs);

}  // namespace probelab
