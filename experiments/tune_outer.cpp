// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_outer.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "base/error.h"
#include "tune_check.h"

namespace probelab {
namespace {

constexpr double kFirstStep = 0.25, kLastStep = 0.02;  // of a range
constexpr double kLeastGain = 1e-3;                    // of the cost, for a value to be kept

double outerValue(const OuterKey& key, const Params& params) {
  return toJson(params)[key.name].get<double>();
}

double toUnit(const OuterKey& key, double value) {
  const double u = key.logarithmic ? std::log(value / key.low) / std::log(key.high / key.low)
                                   : (value - key.low) / (key.high - key.low);
  return std::clamp(u, 0.0, 1.0);
}

// Four digits, so that files stay readable.
double fromUnit(const OuterKey& key, double u) {
  const double value = key.logarithmic ? key.low * std::pow(key.high / key.low, u)
                                       : key.low + u * (key.high - key.low);
  return key.integer ? std::round(value) : std::stod(fmt::format("{:.4g}", value));
}

class Search {
 public:
  Search(TuneFields& fields, const TuneProblem& problem, const TuneSettings& settings, Tuned& tuned,
         const Invocation& invocation)
      : fields_(fields),
        problem_(problem),
        settings_(settings),
        tuned_(tuned),
        invocation_(invocation),
        best_(tuned.params),
        best_cost_(tuned.cost) {
    for (const OuterKey& key : problem.keys.outer) values_.push_back(outerValue(key, tuned.params));
  }

  const Params& best() const { return best_; }
  bool found() const { return found_; }

  void run() {
    for (double step = kFirstStep; step >= kLastStep;)
      if (left() <= 0)
        return;
      else if (!sweep(step))
        step /= 2;
  }

 private:
  int left() const { return settings_.outer_evaluations - static_cast<int>(tuned_.outer.size()); }

  // Each key once, up and else down; true where that helped.
  bool sweep(double step) {
    bool helped = false;
    for (std::size_t i = 0; i < values_.size(); ++i)
      for (const double direction : {1.0, -1.0}) {
        if (left() <= 0) return helped;
        const OuterKey& key = problem_.keys.outer[i];
        const double u = std::clamp(toUnit(key, values_[i]) + direction * step, 0.0, 1.0);
        std::vector<double> values = values_;
        values[i] = fromUnit(key, u);
        if (!seen_.insert(values).second || !tryValues(values)) continue;
        helped = true;
        break;
      }
    return helped;
  }

  bool tryValues(const std::vector<double>& values) {
    Params params = best_;
    const std::optional<double> cost = costOf(values, params);
    const bool kept = cost && *cost < (1 - kLeastGain) * best_cost_;
    tuned_.outer.push_back({values, cost.value_or(std::nan("")), kept});
    note(invocation_, "outer search: {:g}: cost {:.4g}{}", fmt::join(values, ", "),
         cost.value_or(std::nan("")), kept ? ", kept" : "");
    if (kept) best_ = params, best_cost_ = *cost, values_ = values, found_ = true;
    return kept;
  }

  // With `params` set to the solution of the inner keys. Empty where the values do not go together.
  std::optional<double> costOf(const std::vector<double>& values, Params& params) {
    try {
      for (std::size_t i = 0; i < values.size(); ++i)
        setOuterKey(problem_.keys.outer[i], values[i], params);
      validateParams(params);
    } catch (const InputError&) {
      return std::nullopt;
    }
    const HeldFields held(fields_, problem_, params, settings_.objective);
    const double cost = held.cost(params);
    const Params ran = params;
    Params solved = params;
    if (!problem_.keys.inner.empty()) {
      SolveSettings single = settings_.solve;
      single.starts = 1, single.candidates = 0;
      solveInner(held, problem_, params, single, tuned_, solved);
      solved = partOfSolution(problem_, problem_.from, solved, tuned_.check.share);
    }
    const double solved_cost = held.cost(solved);
    fields_.forget(ran);
    if (solved_cost < cost) params = solved;
    return std::min(cost, solved_cost);
  }

  TuneFields& fields_;
  const TuneProblem& problem_;
  const TuneSettings& settings_;
  Tuned& tuned_;
  const Invocation& invocation_;
  Params best_;
  double best_cost_;
  std::vector<double> values_;  // [outer key], of the best
  std::set<std::vector<double>> seen_;
  bool found_ = false;
};

}  // namespace

void searchOuter(TuneFields& fields, const TuneProblem& problem, const TuneSettings& settings,
                 Tuned& tuned, const Invocation& invocation) {
  Search search(fields, problem, settings, tuned, invocation);
  search.run();
  if (!search.found()) return;
  Tuned trial = tuned;
  trial.params = search.best();
  trial.cost = HeldFields(fields, problem, trial.params, settings.objective).cost(trial.params);
  if (!problem.keys.inner.empty())
    alternate(fields, problem, settings, std::max(1, settings.rounds / 2), false, trial,
              invocation);
  trial.outer_kept = trial.cost < tuned.cost;
  if (trial.outer_kept) {
    tuned = trial;
    return;
  }
  // Its work counts all the same.
  tuned.evaluations = trial.evaluations, tuned.gradients = trial.gradients;
  tuned.solve_s = trial.solve_s;
}

}  // namespace probelab
