// SPDX-License-Identifier: GPL-3.0-or-later
#include "bounded_solve.h"

#include <algorithm>
#include <cmath>

namespace probelab {
namespace {

using Vector = std::vector<double>;

constexpr double kTolerance = 1e-10;  // of the residual of the normal equations, relative
constexpr int kMaxRounds = 50;
constexpr int kMaxHalvings = 30;

double dotProduct(const Vector& x, const Vector& y) {
  double sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += x[i] * y[i];
  return sum;
}

class NormalEquations {
 public:
  explicit NormalEquations(const BoundedProblem& problem) : p_(problem), diagonal_(p_.unknowns) {
    std::fill(diagonal_.begin(), diagonal_.end(), p_.pull);
    for (std::size_t e = 0; e < p_.columns.size(); ++e)
      diagonal_[p_.columns[e]] += p_.values[e] * p_.values[e];
    for (const auto& [i, j] : p_.pairs) diagonal_[i] += p_.smooth, diagonal_[j] += p_.smooth;
  }

  const Vector& diagonal() const { return diagonal_; }

  // (A^T A + priors) x - A^T b; without b where `homogeneous`.
  Vector apply(const Vector& x, bool homogeneous) const {
    Vector result(p_.unknowns);
    for (std::size_t r = 0; r + 1 < p_.row_begin.size(); ++r) {
      double sum = homogeneous ? 0 : -p_.b[r];
      for (uint32_t e = p_.row_begin[r]; e < p_.row_begin[r + 1]; ++e)
        sum += p_.values[e] * x[p_.columns[e]];
      for (uint32_t e = p_.row_begin[r]; e < p_.row_begin[r + 1]; ++e)
        result[p_.columns[e]] += p_.values[e] * sum;
    }
    for (std::size_t i = 0; i < x.size(); ++i) result[i] += p_.pull * x[i];
    for (const auto& [i, j] : p_.pairs) {
      const double pull = p_.smooth * (x[i] - x[j]);
      result[i] += pull, result[j] -= pull;
    }
    return result;
  }

 private:
  const BoundedProblem& p_;
  Vector diagonal_;
};

// The step d, 0 where not free, that solves the equations for x + d among the free unknowns:
// conjugate gradients with the diagonal as preconditioner. Returns the iterations.
int freeStep(const NormalEquations& equations, const std::vector<uint8_t>& free,
             const Vector& gradient, int iterations, Vector& step) {
  const std::size_t n = gradient.size();
  Vector residual(n), z(n), direction(n);
  step.assign(n, 0);
  const auto precondition = [&] {
    for (std::size_t i = 0; i < n; ++i)
      z[i] = free[i] != 0 ? residual[i] / equations.diagonal()[i] : 0;
  };
  for (std::size_t i = 0; i < n; ++i) residual[i] = free[i] != 0 ? -gradient[i] : 0;
  precondition();
  direction = z;
  double rz = dotProduct(residual, z);
  const double enough = rz * kTolerance * kTolerance;
  int done = 0;
  for (; done < iterations && rz > enough; ++done) {
    Vector image = equations.apply(direction, true);
    const double alpha = rz / dotProduct(direction, image);
    for (std::size_t i = 0; i < n; ++i) {
      if (free[i] == 0) continue;
      step[i] += alpha * direction[i];
      residual[i] -= alpha * image[i];
    }
    precondition();
    const double next = dotProduct(residual, z), beta = next / rz;
    rz = next;
    for (std::size_t i = 0; i < n; ++i) direction[i] = z[i] + beta * direction[i];
  }
  return done;
}

}  // namespace

BoundedSolution solveBounded(const BoundedProblem& problem, std::vector<double> start,
                             int iterations) {
  const NormalEquations equations(problem);
  const std::size_t n = problem.unknowns;
  BoundedSolution solution{std::move(start), 0};
  Vector& x = solution.x;
  Vector step, moved(n);
  std::vector<uint8_t> free(n);
  for (int round = 0; round < kMaxRounds; ++round) {
    const Vector gradient = equations.apply(x, false);
    for (std::size_t i = 0; i < n; ++i) free[i] = x[i] > problem.low[i] || gradient[i] < 0 ? 1 : 0;
    solution.iterations += freeStep(equations, free, gradient, iterations, step);
    // The change of the objective / 2 along the way back into the bounds.
    bool bent = false;
    double share = 1;
    for (int k = 0; k < kMaxHalvings; ++k, share /= 2) {
      Vector change(n);
      bent = false;
      for (std::size_t i = 0; i < n; ++i) {
        const double wanted = x[i] + share * step[i];
        moved[i] = std::max(problem.low[i], wanted);
        bent = bent || wanted < problem.low[i];
        change[i] = moved[i] - x[i];
      }
      const double curvature = dotProduct(change, equations.apply(change, true));
      if (dotProduct(gradient, change) + curvature / 2 <= 0) break;
    }
    x = moved;
    if (bent || share < 1) continue;
    // Nothing met its bound: done unless one at its bound wants to leave it.
    const Vector after = equations.apply(x, false);
    bool leaves = false;
    for (std::size_t i = 0; i < n; ++i)
      leaves = leaves || (free[i] == 0 && after[i] < -kTolerance * equations.diagonal()[i]);
    if (!leaves) break;
  }
  return solution;
}

}  // namespace probelab
