// SPDX-License-Identifier: GPL-3.0-or-later
// Sparse least squares with lower bounds.
#pragma once

#include <cstdint>
#include <vector>

namespace probelab {

// |A x - b|^2 + sum of pull_k x_k^2 + smooth * sum over pairs of (x_i - x_j)^2, for x >= low, where
// low <= 0.
struct BoundedProblem {
  std::size_t unknowns = 0;
  std::vector<uint32_t> row_begin;  // [row + 1], into `columns` and `values`
  std::vector<uint32_t> columns;
  std::vector<double> values;
  std::vector<double> b;  // [row]
  std::vector<double> low;
  double pull = 0;  // > 0
  double smooth = 0;
  std::vector<std::pair<uint32_t, uint32_t>> pairs;
};

struct BoundedSolution {
  std::vector<double> x;
  int iterations = 0;  // of conjugate gradients, over all rounds
};

// From `start`, which keeps the bounds. Conjugate gradients on the unknowns that are free, which
// are then put back into the bounds along the step; again with those free that want to move away
// from their bound, until none does (Moré and Toraldo, SIAM J. Optim. 1(1), 1991, with the whole
// system solved each time). `iterations` bounds those of a round.
BoundedSolution solveBounded(const BoundedProblem& problem, std::vector<double> start,
                             int iterations);

}  // namespace probelab
