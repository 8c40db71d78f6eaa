// SPDX-License-Identifier: GPL-3.0-or-later
// The receivers that a field is scored at, as options of the commands that score one field.
#pragma once

#include <optional>
#include <string>

#include "ddgi/run_field.h"
#include "field_setup.h"
#include "json.h"
#include "truth.h"

namespace probelab {

struct ScoredReceiverOptions {
  TruthOptions truth;
  std::string file;               // as `probelab receivers` writes; empty: traced, or cached
  std::string split = "heldout";  // parseScoredSplit
};

// --receivers, --split and those of addTruthOptions.
void addScoredReceiverOptions(CLI::App& app, ScoredReceiverOptions& options);

Truth obtainTruth(const ScoredReceiverOptions& options, const SceneSetup& setup,
                  const Invocation& invocation);

// "receivers" of a result.
Json receiversJson(const ScoredReceiverOptions& options, const Truth& truth);

// "converged" of a result; null for a temporal run.
Json convergedJson(const std::optional<ConvergeReport>& report);

}  // namespace probelab
