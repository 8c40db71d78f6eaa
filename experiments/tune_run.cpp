// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/progress.h"
#include "base/timer.h"
#include "table.h"
#include "tune_outer.h"

namespace probelab {
namespace {

constexpr double kSettledMove = 0.01;   // of a range
constexpr double kSettledGain = 0.005;  // of the cost
constexpr int kHalvings = 3;
constexpr std::size_t kScenesAsFolds = 3;  // so many and more
constexpr int kLaterStarts = 4, kLaterCandidates = 16;  // than the first solution's
constexpr int kFoldStarts = 2, kFoldCandidates = 8;     // of the cross-validation's
constexpr double kLeastError = 1e-6;  // squared, of a state's weight: nrmse 0.001

// Digits of a tuned value; far below what matters, and files stay readable.
double rounded(double value) { return std::stod(fmt::format("{:.6g}", value)); }

// A share of the step, values rounded to what a file holds.
Params between(const std::vector<TunedKey>& keys, const Params& from, const Params& to,
               double share) {
  Params params = partOfStep(keys, from, to, share);
  for (const TunedKey& key : keys) params.*key.value = rounded(params.*key.value);
  return params;
}

double largestMove(const std::vector<TunedKey>& keys, const Params& a, const Params& b) {
  double largest = 0;
  for (const TunedKey& key : keys)
    largest = std::max(largest, std::abs(a.*key.value - b.*key.value) / (key.high - key.low));
  return largest;
}

// `solved` with values of the start in their places, the cheapest first, while the cost stays below
// (1 + parsimony) times the solution's.
Params simplified(const TuneObjective& objective, const TuneProblem& problem, Params solved,
                  double parsimony) {
  const auto cost_of = [&](const Params& params) { return scoreParams(objective, params).cost; };
  const double allowed = (1 + parsimony) * cost_of(solved);
  for (std::size_t turn = 0; turn < problem.keys.inner.size(); ++turn) {
    std::optional<Params> best;
    double least = allowed;
    for (const TunedKey& key : problem.keys.inner) {
      Params tried = solved;
      tried.*key.value = problem.from.*key.value;
      if (tried.*key.value == solved.*key.value) continue;
      if (const double cost = cost_of(tried); cost <= least) best = tried, least = cost;
    }
    if (!best) break;
    solved = *best;
  }
  return solved;
}

SolveSettings fewerStarts(SolveSettings settings, int starts, int candidates) {
  settings.starts = std::min(settings.starts, starts);
  settings.candidates = std::min(settings.candidates, candidates);
  return settings;
}

// [part][point]. Among several scenes each is a fold: what holds in the others should hold there.
std::vector<std::vector<int>> foldsOf(const TuneProblem& problem, const HeldFields& held,
                                      int& folds) {
  std::vector<const TuneScene*> scenes;
  for (const TunePart& part : problem.parts)
    if (std::ranges::find(scenes, part.scene) == scenes.end()) scenes.push_back(part.scene);
  const bool by_scene = scenes.size() >= kScenesAsFolds;
  if (by_scene) folds = static_cast<int>(scenes.size());
  std::vector<std::vector<int>> fold_of;
  for (std::size_t i = 0; i < problem.parts.size(); ++i) {
    const TuneScene& scene = *problem.parts[i].scene;
    const auto of_scene =
        static_cast<int>(std::ranges::find(scenes, &scene) - scenes.begin());
    std::vector<int>& of_points = fold_of.emplace_back();
    for (const TunePoint& point : held.states()[i].points)
      of_points.push_back(by_scene ? of_scene
                                   : receiverFold(scene.scene.bounds, point.query.position, folds));
  }
  return fold_of;
}

// How much of the step to a solution holds where it was not sought.
StepCheck checkSolution(const HeldFields& held, const TuneProblem& problem,
                        const TuneSettings& settings, Tuned& count, bool quiet) {
  int folds = settings.folds;
  const std::vector<std::vector<int>> fold_of = foldsOf(problem, held, folds);
  Progress progress("cross-validation", static_cast<uint64_t>(folds), quiet);
  int done = 0;
  const Timer timer;
  StepCheck check = checkStep(
      held.objective(problem.from), fold_of, folds, [&](const TuneObjective& others) {
        const SolveResult result =
            solveTuning(others, fewerStarts(settings.solve, kFoldStarts, kFoldCandidates),
                        [](double) { throwIfInterrupted(); });
        Params solved = problem.from;
        setCoordinates(problem.keys.inner, result.x, solved);
        if (settings.parsimony > 0)
          solved = simplified(others, problem, solved, settings.parsimony);
        count.evaluations += result.evaluations, count.gradients += result.gradients;
        progress.update(++done);
        return solved;
      });
  progress.finish();
  count.solve_s += timer.seconds();
  return check;
}

// A round's steps: the solution, then halves of it, until the field that is run with it is no
// worse.
void takeStep(TuneFields& fields, const TuneProblem& problem, const TuneSettings& settings,
              const Params& solved, Tuned& tuned, TuneRound& round) {
  double share = 1;
  for (int i = 0; i <= kHalvings; ++i, share /= 2) {
    const Params tried = between(problem.keys.inner, tuned.params, solved, share);
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
       round.step == 0   ? ", no step helped"
       : round.step == 1 ? ""
                         : fmt::format(", {:g} of the step", round.step));
}

}  // namespace

HeldFields::HeldFields(TuneFields& fields, const TuneProblem& problem, const Params& params,
                       const ObjectiveSettings& settings)
    : keys_(problem.keys.inner), settings_(settings) {
  for (std::size_t i = 0; i < problem.parts.size(); ++i) {
    states_.push_back(*fields.frozen(problem.parts[i], params));
    states_.back().weight = problem.weights.empty() ? 1 : problem.weights[i];
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
  for (const TunedKey& key : problem.keys.inner) solved.*key.value = rounded(solved.*key.value);
  count.evaluations += result.evaluations, count.gradients += result.gradients;
  count.solve_s += timer.seconds();
  return result;
}

void alternate(TuneFields& fields, const TuneProblem& problem, const TuneSettings& settings,
               int rounds, bool multi_start, Tuned& tuned, const Invocation& invocation) {
  const SolveSettings later = fewerStarts(settings.solve, kLaterStarts, kLaterCandidates);
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
      tuned.check = checkSolution(held, problem, settings, tuned, invocation.common.quiet);
    solved = between(problem.keys.inner, problem.from, solved, tuned.check.share);
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
