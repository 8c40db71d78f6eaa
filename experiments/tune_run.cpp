// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/progress.h"
#include "base/timer.h"
#include "table.h"
#include "tune_check.h"
#include "tune_outer.h"

namespace probelab {
namespace {

constexpr double kSettledMove = 0.01;   // of a range
constexpr double kSettledGain = 0.005;  // of the cost
constexpr int kHalvings = 3;
constexpr int kLaterStarts = 4, kLaterCandidates = 16;
constexpr double kLeastError = 1e-6;  // squared, of a state's weight: nrmse 0.001

double largestMove(const std::vector<TunedKey>& keys, const Params& a, const Params& b) {
  double largest = 0;
  for (const TunedKey& key : keys)
    largest = std::max(largest, std::abs(a.*key.value - b.*key.value) / (key.high - key.low));
  return largest;
}

// A round's steps: the solution, then halves of it, until the field that is run with it is no
// worse.
void takeStep(TuneFields& fields, const TuneProblem& problem, const TuneSettings& settings,
              const Params& solved, Tuned& tuned, TuneRound& round) {
  double share = 1;
  for (int i = 0; i <= kHalvings; ++i, share /= 2) {
    const Params tried = partOfSolution(problem, tuned.params, solved, share);
    round.params = tried;
    round.moved = largestMove(problem.keys.inner, tuned.params, tried);
    if (round.moved == 0) break;
    const HeldFields held(fields, problem, tried, settings.objective);
    ++round.fields;
    const double cost = held.cost(tried);
    if (cost <= tuned.cost) {
      // Those of the start are asked for again: by the scores and by other sets of scenes.
      if (describeParams(tuned.params) != describeParams(problem.from)) fields.forget(tuned.params);
      tuned.params = tried, tuned.cost = round.after = cost, round.step = share;
      return;
    }
    fields.forget(tried);
  }
  round.params = tuned.params, round.moved = 0;
}

void noteRound(const Tuned& tuned, const Invocation& invocation) {
  const TuneRound& round = tuned.rounds.back();
  note(invocation, "round {}: cost {} -> {} held still -> {} run again{}", tuned.rounds.size(),
       formatNumber(round.before), formatNumber(round.solved), formatNumber(round.after),
       tuned.check.share == 0 ? ", cross-validation keeps the start's values"
       : round.step == 0      ? ", no step helped"
       : round.step == 1      ? ""
                              : fmt::format(", {:g} of the step", round.step));
}

}  // namespace

HeldFields::HeldFields(TuneFields& fields, const TuneProblem& problem, const Params& params,
                       const ObjectiveSettings& settings)
    : keys_(problem.keys.inner), settings_(settings) {
  const bool varies_parallax = std::ranges::any_of(
      keys_, [](const TunedKey& key) { return key.value == &Params::parallax; });
  for (std::size_t i = 0; i < problem.parts.size(); ++i) {
    states_.push_back(*fields.frozen(problem.parts[i], params));
    states_.back().weight = problem.weights.empty() ? 1 : problem.weights[i];
    // A field whose parallax is 0 leaves it out; asked for, it reads the same and has a derivative.
    if (varies_parallax) states_.back().field.modes.parallax = 1;
  }
}

TuneObjective HeldFields::objective(const Params& base) const {
  return {states_, keys_, base, settings_};
}

double HeldFields::cost(const Params& params) const {
  return scoreParams(objective(params), params).cost;
}

std::vector<double> partWeights(TuneFields& fields, const std::vector<TunePart>& parts,
                                const Params& from, const ObjectiveSettings& settings) {
  std::vector<double> weights;
  for (const TunePart& part : parts) {
    const HeldFields held(fields, {{part}, {}, from, {}}, from, settings);
    const double error = std::max(held.cost(from) - held.states().front().noise, kLeastError);
    const auto states = std::count_if(parts.begin(), parts.end(), [&](const TunePart& other) {
      return other.scene == part.scene;
    });
    weights.push_back(1 / (error * static_cast<double>(states)));
  }
  return weights;
}

SolveResult solveInner(const HeldFields& held, const TuneProblem& problem, const Params& base,
                       const SolveSettings& settings, Tuned& count, Params& solved, bool quiet) {
  const Timer timer;
  Progress progress("solve", 1, quiet);
  SolveResult result = solveTuning(held.objective(base), settings, [&](double done) {
    throwIfInterrupted();
    progress.update(done);
  });
  progress.finish();
  solved = base;
  setCoordinates(problem.keys.inner, result.x, solved);
  solved = rounded(problem, solved);
  count.evaluations += result.evaluations, count.gradients += result.gradients;
  count.solve_s += timer.seconds();
  return result;
}

void alternate(TuneFields& fields, const TuneProblem& problem, const TuneSettings& settings,
               int rounds, bool multi_start, Tuned& tuned, const Invocation& invocation) {
  SolveSettings later = settings.solve;
  later.starts = std::min(later.starts, kLaterStarts);
  later.candidates = std::min(later.candidates, kLaterCandidates);
  tuned.settled = false;
  for (int i = 0; i < rounds && !tuned.settled; ++i) {
    const HeldFields held(fields, problem, tuned.params, settings.objective);
    const bool first = multi_start && i == 0;
    Params solved;
    SolveResult result = solveInner(held, problem, tuned.params, first ? settings.solve : later,
                                    tuned, solved, invocation.common.quiet);
    if (settings.parsimony > 0)
      solved = simplified(held.objective(solved), problem, solved, settings.parsimony);
    if (first && settings.folds > 0)
      tuned.check =
          checkSolution(held, problem, settings, solved, tuned, invocation.common.quiet);
    solved = partOfSolution(problem, problem.from, solved, tuned.check.share);
    TuneRound round;
    round.before = round.after = tuned.cost;
    round.solved = result.cost;
    if (first) tuned.first = std::move(result);
    takeStep(fields, problem, settings, solved, tuned, round);
    tuned.settled = round.step == 0 ||
                    (round.moved < kSettledMove && round.after > (1 - kSettledGain) * round.before);
    tuned.rounds.push_back(round);
    noteRound(tuned, invocation);
  }
}

Tuned tuneParams(TuneFields& fields, const TuneProblem& problem, const TuneSettings& settings,
                 const Invocation& invocation) {
  Tuned tuned;
  tuned.params = problem.from;
  tuned.cost_from = tuned.cost =
      HeldFields(fields, problem, problem.from, settings.objective).cost(problem.from);
  if (!problem.keys.inner.empty())
    alternate(fields, problem, settings, settings.rounds, true, tuned, invocation);
  if (!problem.keys.outer.empty()) searchOuter(fields, problem, settings, tuned, invocation);
  if (!problem.keys.inner.empty()) {
    SolveSettings single = settings.solve;
    single.starts = 1, single.candidates = 0;
    Params unused;
    tuned.local = solveInner(HeldFields(fields, problem, tuned.params, settings.objective), problem,
                             tuned.params, single, tuned, unused);
  }
  return tuned;
}

}  // namespace probelab
