// SPDX-License-Identifier: GPL-3.0-or-later
// What a tuning found, as JSON, as text and as the file of parameters itself.
#pragma once

#include <string>
#include <vector>

#include "json.h"
#include "provenance.h"
#include "tune_run.h"
#include "tune_scores.h"

namespace probelab {

// Tuned without one of the scenes, scored on it.
struct TuneFold {
  const TuneScene* scene = nullptr;
  Tuned tuned;
  std::vector<PartScore> scores;
};

struct TuneOutcome {
  const TuneScenes& scenes;
  const TuneProblem& problem;
  const std::vector<std::string>& presets;  // of --against
  std::vector<std::string> names;           // of the keys that were varied, in the order given
  Tuned tuned;
  std::vector<PartScore> scores;
  std::vector<TuneFold> folds;
  Provenance provenance;
};

// Every member of the result but those of extras; with `blocks` held-out errors by block too.
Json toJson(const TuneOutcome& outcome, bool blocks);
// The same names without numbers, for checkRequirementNames.
Json tuneOutline();

std::string formatOutcome(const TuneOutcome& outcome);

// Values of keys as text, and a value of any key of the table.
double paramValue(const Params& params, const std::string& key);

}  // namespace probelab
