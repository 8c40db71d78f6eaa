// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>

#include "base/interrupt.h"
#include "base/progress.h"
#include "base/timer.h"

namespace probelab {
namespace {

constexpr std::size_t kScenesAsFolds = 3;  // among so many scenes and more each is a fold

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
    const auto of_scene = static_cast<int>(std::ranges::find(scenes, &scene) - scenes.begin());
    std::vector<int>& of_points = fold_of.emplace_back();
    for (const TunePoint& point : held.states()[i].points)
      of_points.push_back(by_scene ? of_scene
                                   : receiverFold(scene.scene.bounds, point.query.position, folds));
  }
  return fold_of;
}

}  // namespace

Params rounded(const TuneProblem& problem, Params params) {
  for (const TunedKey& key : problem.keys.inner)
    params.*key.value = std::stod(fmt::format("{:.6g}", params.*key.value));
  return params;
}

Params partOfSolution(const TuneProblem& problem, const Params& from, const Params& solved,
                      double share) {
  Params start = solved;
  for (const TunedKey& key : problem.keys.inner) start.*key.value = from.*key.value;
  return rounded(problem, partOfStep(problem.keys.inner, start, solved, share));
}

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

StepCheck checkSolution(const HeldFields& held, const TuneProblem& problem,
                        const TuneSettings& settings, const Params& solved, Tuned& count,
                        bool quiet) {
  int folds = settings.folds;
  const std::vector<std::vector<int>> fold_of = foldsOf(problem, held, folds);
  Progress progress("cross-validation", static_cast<uint64_t>(folds), quiet);
  int done = 0;
  const Timer timer;
  SolveSettings single = settings.solve;
  single.starts = 1, single.candidates = 0;
  const auto solve_again = [&](const TuneObjective& others) {
    TuneObjective from_solved = others;
    from_solved.base = solved;
    const SolveResult result =
        solveTuning(from_solved, single, [](double) { throwIfInterrupted(); });
    count.evaluations += result.evaluations, count.gradients += result.gradients;
    Params found = problem.from;
    setCoordinates(problem.keys.inner, result.x, found);
    if (settings.parsimony > 0) found = simplified(others, problem, found, settings.parsimony);
    progress.update(++done);
    return found;
  };
  const StepCheck check = checkStep(held.objective(problem.from), fold_of, folds,
                                    settings.parsimony, solve_again);
  progress.finish();
  count.solve_s += timer.seconds();
  return check;
}

}  // namespace probelab
