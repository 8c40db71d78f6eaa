// SPDX-License-Identifier: GPL-3.0-or-later
#include "tuning/solve.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <numeric>
#include <utility>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/rng.h"
#include "optimum.h"

namespace probelab {
namespace {

using Point = std::vector<double>;

// Ceres moves y with x = 1 / (1 + exp(-y)): its own bounds stick. Starts keep this distance from
// the ends, where the sigmoid is flat; the polish reaches them.
constexpr double kStartMargin = 0.02;

double sigmoid(double y) { return 1 / (1 + std::exp(-y)); }
double logit(double x) {
  const double held = std::clamp(x, kStartMargin, 1 - kStartMargin);
  return std::log(held / (1 - held));
}
Point sigmoids(const double* y, std::size_t count) {
  Point x(count);
  for (std::size_t k = 0; k < count; ++k) x[k] = sigmoid(y[k]);
  return x;
}

// Evaluates the objective and keeps count.
class Evaluator {
 public:
  Evaluator(const TuneObjective& objective, SolveResult& result)
      : objective_(objective), result_(result) {}

  double cost(const Point& x) {
    std::vector<double> residuals(residualCount(objective_));
    return evaluate(x, residuals, {});
  }
  double evaluate(const Point& x, std::span<double> residuals, std::span<double> jacobian) {
    throwIfInterrupted();
    evaluateResiduals(objective_, x, residuals, jacobian);
    double sum = 0;
    for (const double r : residuals) sum += r * r;
    count(sum, !jacobian.empty());
    if (best_.x.empty() || sum < best_.cost) best_ = {x, sum};
    return sum;
  }
  // The lowest so far: Levenberg-Marquardt refuses steps that gain less than they promised.
  const SolveStep& best() const { return best_; }
  const TuneObjective& objective() const { return objective_; }

 private:
  // Derivatives count as what differences would take.
  void count(double cost, bool with_gradient) {
    ++result_.evaluations;
    if (with_gradient) ++result_.gradients;
    const double best =
        result_.best_after.empty() ? cost : std::min(cost, result_.best_after.back());
    result_.best_after.insert(result_.best_after.end(),
                              1 + (with_gradient ? objective_.keys.size() : 0), best);
  }

  const TuneObjective& objective_;
  SolveResult& result_;
  SolveStep best_;
};

// The residuals over y. What an evaluation throws is kept, since it must not pass through Ceres.
class Residuals final : public ceres::CostFunction {
 public:
  Residuals(Evaluator& evaluator, std::exception_ptr& failure)
      : evaluator_(evaluator), failure_(failure) {
    set_num_residuals(static_cast<int>(residualCount(evaluator.objective())));
    mutable_parameter_block_sizes()->push_back(
        static_cast<int32_t>(evaluator.objective().keys.size()));
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const std::size_t keys = evaluator_.objective().keys.size();
    const auto rows = static_cast<std::size_t>(num_residuals());
    const Point x = sigmoids(parameters[0], keys);
    const bool wanted = jacobians != nullptr && jacobians[0] != nullptr;
    const std::span<double> jacobian =
        wanted ? std::span<double>(jacobians[0], rows * keys) : std::span<double>();
    try {
      evaluator_.evaluate(x, {residuals, rows}, jacobian);
    } catch (...) {
      failure_ = std::current_exception();
      return false;
    }
    for (std::size_t i = 0; i < jacobian.size(); ++i) {
      const double u = x[i % keys];
      jacobian[i] *= u * (1 - u);
    }
    return true;
  }

 private:
  Evaluator& evaluator_;
  std::exception_ptr& failure_;
};

// Records the steps that Ceres accepts.
class Recorder final : public ceres::IterationCallback {
 public:
  Recorder(const Point& y, SolvePath& path) : y_(y), path_(path) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    const double cost = 2 * summary.cost;  // Ceres halves the sum of squares
    if (path_.steps.empty() || cost < path_.steps.back().cost)
      path_.steps.push_back({sigmoids(y_.data(), y_.size()), cost});
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const Point& y_;
  SolvePath& path_;
};

std::string endOf(const ceres::Solver::Summary& summary) {
  if (summary.termination_type == ceres::NO_CONVERGENCE) return "iterations spent";
  if (summary.termination_type != ceres::CONVERGENCE) return "no step lowers the cost";
  if (summary.message.find("Gradient") == 0) return "gradient vanishes";
  if (summary.message.find("Parameter") == 0) return "steps vanish";
  return "cost settled";
}

SolvePath runStart(Evaluator& evaluator, const Point& start, int iterations, int& evaluations) {
  SolvePath path;
  Point y;
  for (const double x : start) y.push_back(logit(x));
  std::exception_ptr failure;
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  Residuals residuals(evaluator, failure);
  ceres::Problem problem(ownership);
  problem.AddResidualBlock(&residuals, nullptr, y.data());
  Recorder recorder(y, path);
  ceres::Solver::Options options;
  options.minimizer_type = ceres::TRUST_REGION;
  options.trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = iterations;
  options.function_tolerance = 1e-5;
  options.initial_trust_region_radius = 10;  // a full step may cross the range into the flat end
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  options.update_state_every_iteration = true;
  options.callbacks.push_back(&recorder);
  ceres::Solver::Summary summary;
  const int before = evaluations;
  ceres::Solve(options, &problem, &summary);
  if (failure) std::rethrow_exception(failure);
  path.ended = endOf(summary);
  path.evaluations = evaluations - before;
  return path;
}

// A Latin hypercube: every key has one candidate in each of `count` strata.
std::vector<Point> coarseSet(std::size_t keys, int count, uint64_t seed) {
  std::vector<Point> points(static_cast<std::size_t>(count), Point(keys));
  for (std::size_t k = 0; k < keys; ++k) {
    Rng rng(seed, RngStream::tuning, 0, k);
    std::vector<std::size_t> order(points.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[rng.nextBelow(i)]);
    for (std::size_t i = 0; i < points.size(); ++i)
      points[i][k] = (static_cast<double>(order[i]) + rng.nextDouble()) / count;
  }
  return points;
}

// The best of the coarse set.
std::vector<Point> chooseStarts(Evaluator& evaluator, const SolveSettings& settings) {
  const TuneObjective& objective = evaluator.objective();
  std::vector<SolveStep> candidates;
  for (Point& x : coarseSet(objective.keys.size(), settings.candidates, settings.seed)) {
    const double cost = evaluator.cost(x);
    candidates.push_back({std::move(x), cost});
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const SolveStep& a, const SolveStep& b) { return a.cost < b.cost; });
  const auto wanted = static_cast<std::size_t>(settings.starts - 1);
  std::vector<Point> starts;
  for (std::size_t i = 0; i < std::min(wanted, candidates.size()); ++i)
    starts.push_back(candidates[i].x);
  return starts;
}

}  // namespace

SolveResult solveTuning(const TuneObjective& objective, const SolveSettings& settings,
                        const std::function<void(double)>& progress) {
  PROBELAB_CHECK(settings.starts >= 1 && settings.candidates >= 0 && settings.iterations >= 1);
  SolveResult result;
  Evaluator evaluator(objective, result);
  const Point base = toCoordinates(objective.keys, objective.base);
  evaluator.cost(base);  // as it is; a start is held off the ends
  const auto run = [&](const Point& start) {
    result.paths.push_back(runStart(evaluator, start, settings.iterations, result.evaluations));
    const auto end = [&](std::size_t path) { return result.paths[path].steps.back().cost; };
    const std::size_t last = result.paths.size() - 1;
    if (end(last) < end(static_cast<std::size_t>(result.best)))
      result.best = static_cast<int>(last);
    if (progress) progress(0.9 * static_cast<double>(last + 1) / settings.starts);
  };
  run(base);
  if (settings.starts > 1)
    for (const Point& start : chooseStarts(evaluator, settings)) run(start);
  const auto cost = [&](const Point& x) { return evaluator.cost(x); };
  const int before = result.evaluations;
  const SolveStep lowest = evaluator.best();
  SolvePath polish = polishOptimum(objective, lowest, cost);
  polish.evaluations = result.evaluations - before;
  result.x = evaluator.best().x;
  result.cost = evaluator.best().cost;
  result.paths.push_back(std::move(polish));
  describeOptimum(objective, result);
  if (progress) progress(1);
  return result;
}

}  // namespace probelab
