// SPDX-License-Identifier: GPL-3.0-or-later
// Tuning of parameters on fields that feed their own light back: the field is held still while the
// query's parameters are solved for, then run again under them, until both agree.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tune_fields.h"
#include "tune_scene.h"
#include "tuning/objective.h"
#include "tuning/solve.h"
#include "tuning/step_check.h"

namespace probelab {

struct TuneSettings {
  ObjectiveSettings objective;
  SolveSettings solve;  // of the first solution; later ones start from the one before
  int rounds = 4;       // at most: a solution and fields that are run again
  int outer_evaluations = 12;
  // A parameter stays as it was where going back to that raises the cost by less than this share,
  // of all that do together: what hardly matters here may matter under another light.
  double parsimony = 0.005;
  // Cross-validation of the first solution (tuning/step_check.h) in so many folds of blocks of
  // train receivers; from three scenes on each scene is a fold. Values go the share of the way that
  // it says, with `parsimony` as its allowance. 0: they go all of it.
  int folds = 4;
};

// Values that are sought, and parts to seek them on.
struct TuneProblem {
  std::vector<TunePart> parts;
  std::vector<double> weights;  // [part], of its squared error
  Params from;
  KeySplit keys;
};

struct TuneRound {
  Params params;      // tried last
  double before = 0;  // cost of the field and the parameters that the round starts from
  double solved = 0;  // of the solution on that field
  double after = 0;   // with the field run again; `before` where no step helped
  double step = 0;    // share of the way to `solved`, cross-validated, that was kept; 0: none
  double moved = 0;   // largest change of a value, over its range
  int fields = 0;     // runs over all parts
};

struct OuterStep {
  std::vector<double> values;  // [outer key]
  double cost = 0;             // after the inner solution on the field with these
  bool kept = false;
};

struct Tuned {
  Params params;
  double cost_from = 0, cost = 0;  // on fields that were run with them
  bool settled = false;            // before the rounds were used up
  std::vector<TuneRound> rounds;
  std::vector<OuterStep> outer;
  bool outer_kept = false;
  StepCheck check;    // of the first solution; its share holds for all of them
  SolveResult first;  // the multi-start solution
  SolveResult local;  // at the end, of a single start: the train receivers' optimum
  int evaluations = 0, gradients = 0;
  double solve_s = 0;
};

// The problem's objective over fields that were run under given parameters.
class HeldFields {
 public:
  HeldFields(TuneFields& fields, const TuneProblem& problem, const Params& params,
             const ObjectiveSettings& settings);
  double cost(const Params& params) const;  // of any parameters of the query on these fields
  TuneObjective objective(const Params& base) const;
  const std::vector<FrozenState>& states() const { return states_; }

 private:
  std::vector<FrozenState> states_;
  std::vector<TunedKey> keys_;
  ObjectiveSettings settings_;
};

// A weight for each part such that the cost is the sum over scenes of the mean over their states of
// squared error over that under `from`: every scene counts for what can be gained in it.
std::vector<double> partWeights(TuneFields& fields, const std::vector<TunePart>& parts,
                                const Params& from, const ObjectiveSettings& settings);

// From `problem.from`, whose cost is never exceeded. Deterministic.
Tuned tuneParams(TuneFields& fields, const TuneProblem& problem, const TuneSettings& settings,
                 const Invocation& invocation);

// The alternation alone, from `current`, at most `rounds` of them; used by the outer search.
void alternate(TuneFields& fields, const TuneProblem& problem, const TuneSettings& settings,
               int rounds, bool multi_start, Tuned& tuned, const Invocation& invocation);

// The solution of the inner keys over held fields, values rounded to what a file holds.
SolveResult solveInner(const HeldFields& held, const TuneProblem& problem, const Params& base,
                       const SolveSettings& settings, Tuned& count, Params& solved,
                       bool quiet = true);

}  // namespace probelab
