// SPDX-License-Identifier: GPL-3.0-or-later
#include "optimum.h"

#include <ceres/ceres.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"

namespace probelab {
namespace {

using Point = std::vector<double>;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double kFirstStep = 0.08, kLastStep = 1e-3;
constexpr double kLeastGain = 1e-6;  // relative, for a step to count
constexpr int kMostPolish = 1000;    // evaluations
// A direction along which the residuals change less than this share of the strongest is unbound.
constexpr double kUnbound = 1e-7;

Matrix jacobianAt(const TuneObjective& objective, const Point& x) {
  const std::size_t rows = residualCount(objective);
  std::vector<double> residuals(rows);
  Matrix jacobian(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(x.size()));
  evaluateResiduals(objective, x, residuals,
                    {jacobian.data(), static_cast<std::size_t>(jacobian.size())});
  return jacobian;
}

// Columns: right singular vectors.
Eigen::JacobiSVD<Eigen::MatrixXd> decompose(const Matrix& jacobian) {
  // Of the triangular factor: the same values and vectors as of the tall matrix.
  const Eigen::MatrixXd square = Eigen::HouseholderQR<Eigen::MatrixXd>(jacobian)
                                     .matrixQR()
                                     .topRows(jacobian.cols())
                                     .triangularView<Eigen::Upper>();
  return Eigen::JacobiSVD<Eigen::MatrixXd>(square, Eigen::ComputeFullV);
}

std::vector<Point> directionsAt(const TuneObjective& objective, const Point& x) {
  const Eigen::MatrixXd v = decompose(jacobianAt(objective, x)).matrixV();
  std::vector<Point> directions;
  for (std::size_t k = 0; k < x.size(); ++k) {
    Point axis(x.size(), 0.0);
    axis[k] = 1;
    directions.push_back(axis);
  }
  for (Eigen::Index k = 0; x.size() > 1 && k < v.cols(); ++k)
    directions.emplace_back(v.col(k).data(), v.col(k).data() + v.rows());
  return directions;
}

Point moved(const Point& x, const Point& direction, double step) {
  Point to(x.size());
  for (std::size_t k = 0; k < x.size(); ++k)
    to[k] = std::clamp(x[k] + step * direction[k], 0.0, 1.0);
  return to;
}

// The residuals as a function of x itself, for the covariance.
class PlainResiduals final : public ceres::CostFunction {
 public:
  explicit PlainResiduals(const TuneObjective& objective) : objective_(objective) {
    set_num_residuals(static_cast<int>(residualCount(objective)));
    mutable_parameter_block_sizes()->push_back(static_cast<int32_t>(objective.keys.size()));
  }
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const std::size_t keys = objective_.keys.size();
    const auto rows = static_cast<std::size_t>(num_residuals());
    const bool wanted = jacobians != nullptr && jacobians[0] != nullptr;
    evaluateResiduals(objective_, {parameters[0], keys}, {residuals, rows},
                      wanted ? std::span<double>(jacobians[0], rows * keys) : std::span<double>());
    return true;
  }

 private:
  const TuneObjective& objective_;
};

// (J^T J)^-1 by x, a pseudo-inverse where the residuals do not bind all directions.
Matrix covarianceAt(const TuneObjective& objective, Point x) {
  const auto keys = static_cast<Eigen::Index>(x.size());
  ceres::Problem problem;
  problem.AddResidualBlock(new PlainResiduals(objective), nullptr, x.data());
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::DENSE_SVD;
  options.null_space_rank = -1;
  options.min_reciprocal_condition_number = kUnbound * kUnbound;
  ceres::Covariance covariance(options);
  Matrix values = Matrix::Zero(keys, keys);
  if (!covariance.Compute(std::vector<const double*>{x.data()}, &problem) ||
      !covariance.GetCovarianceBlock(x.data(), x.data(), values.data()))
    throw NumericalError("tuning: the covariance at the optimum cannot be computed");
  return values;
}

void fillCovariance(const TuneObjective& objective, const Eigen::MatrixXd& v, SolveResult& result) {
  const std::size_t keys = result.x.size();
  const Matrix covariance = covarianceAt(objective, result.x);
  // Errors per residual, from what is left at the optimum.
  const double freedom =
      std::max(1.0, static_cast<double>(residualCount(objective)) - static_cast<double>(keys));
  const double infinity = std::numeric_limits<double>::infinity();
  std::vector<bool> is_bound(keys, true);
  for (std::size_t s = 0; s < keys; ++s) {
    if (result.singular_values[s] > kUnbound * result.singular_values[0]) continue;
    for (std::size_t k = 0; k < keys; ++k)
      if (std::abs(v(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(s))) > 1e-3)
        is_bound[k] = false;
  }
  const auto at = [&](std::size_t i, std::size_t j) {
    return covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  };
  result.correlation.assign(keys, std::vector<double>(keys, 0.0));
  for (std::size_t i = 0; i < keys; ++i) {
    const double slope = keySlope(objective.keys[i], result.x[i]);
    result.standard_deviations.push_back(
        is_bound[i] ? slope * std::sqrt(at(i, i) * result.cost / freedom) : infinity);
    for (std::size_t j = 0; j < keys; ++j)
      if (is_bound[i] && is_bound[j])
        result.correlation[i][j] = at(i, j) / std::sqrt(at(i, i) * at(j, j));
    result.correlation[i][i] = 1;
  }
}

// `cost` at the result by the same scalar evaluation: with Jets the sum rounds otherwise.
double sensitivityOf(const TuneObjective& objective, const SolveResult& result, double cost,
                     std::size_t key) {
  constexpr double kStep = 0.1;
  double rise = 0;
  int sides = 0;
  for (const double step : {-kStep, kStep}) {
    Point x = result.x;
    x[key] += step;
    if (x[key] < 0 || x[key] > 1) continue;
    rise += evaluateCost(objective, x) / cost - 1;
    ++sides;
  }
  return sides > 0 && cost > 0 ? rise / sides : 0;
}

}  // namespace

SolvePath polishOptimum(const TuneObjective& objective, const SolveStep& start,
                        const std::function<double(const Point&)>& cost) {
  SolvePath path;
  path.steps = {start};
  path.ended = "no step of 0.001 of the range lowers the cost";
  const std::vector<Point> directions = directionsAt(objective, start.x);
  SolveStep best = start;
  int evaluations = 0;
  for (double step = kFirstStep; step >= kLastStep; step /= 2) {
    bool improved = true;
    while (improved) {
      improved = false;
      for (const Point& direction : directions)
        for (const double sign : {1.0, -1.0}) {
          const Point x = moved(best.x, direction, sign * step);
          if (x == best.x) continue;
          if (++evaluations > kMostPolish) {
            path.ended = "evaluations spent";
            return path;
          }
          const double there = cost(x);
          if (!(there < best.cost * (1 - kLeastGain))) continue;
          best = {x, there};
          path.steps.push_back(best);
          improved = true;
        }
    }
  }
  return path;
}

void describeOptimum(const TuneObjective& objective, SolveResult& result) {
  const auto svd = decompose(jacobianAt(objective, result.x));
  const Eigen::VectorXd values = svd.singularValues();
  result.singular_values.assign(values.data(), values.data() + values.size());
  fillCovariance(objective, svd.matrixV(), result);
  const double cost = evaluateCost(objective, result.x);
  for (std::size_t k = 0; k < result.x.size(); ++k)
    result.sensitivity.push_back(sensitivityOf(objective, result, cost, k));
}

}  // namespace probelab
