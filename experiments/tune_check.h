// SPDX-License-Identifier: GPL-3.0-or-later
// What is made of a solution before a field is run with it: values that hardly matter go back to
// the start's, and cross-validation says how far to go.
#pragma once

#include "tune_run.h"

namespace probelab {

// The inner keys' values with six digits: far below what matters, and files stay readable.
Params rounded(const TuneProblem& problem, Params params);

// `solved` with the inner keys a share of the way there from their values in `from`, rounded.
Params partOfSolution(const TuneProblem& problem, const Params& from, const Params& solved,
                      double share);

// `solved` with values of the start in their places, the cheapest first, while the cost stays below
// (1 + parsimony) times the solution's.
Params simplified(const TuneObjective& objective, const TuneProblem& problem, Params solved,
                  double parsimony);

// How much of the step from the start to `solved` holds where it was not sought. Each fold is
// solved on from `solved`, since it is that valley which is in question; `count` gets the
// evaluations.
StepCheck checkSolution(const HeldFields& held, const TuneProblem& problem,
                        const TuneSettings& settings, const Params& solved, Tuned& count,
                        bool quiet);

}  // namespace probelab
