// SPDX-License-Identifier: GPL-3.0-or-later
// Searches that need no derivatives.
#include <algorithm>
#include <limits>

#include "base/error.h"
#include "base/rng.h"
#include "tuning/solve.h"

namespace probelab {
namespace {

using Point = std::vector<double>;

struct Vertex {
  Point x;
  double cost = 0;
};

// Evaluates until the budget is spent; keeps the lowest cost after each evaluation.
struct Counted {
  const TuneObjective& objective;
  std::size_t budget;
  std::vector<double> best_after = {};
  bool spent() const { return best_after.size() >= budget; }
  double operator()(const Point& x) {
    if (spent()) return std::numeric_limits<double>::infinity();
    const double cost = evaluateCost(objective, x);
    best_after.push_back(best_after.empty() ? cost : std::min(best_after.back(), cost));
    return cost;
  }
};

// a + t (b - a), held to the cube.
Point along(const Point& a, const Point& b, double t) {
  Point x(a.size());
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = std::clamp(a[k] + t * (b[k] - a[k]), 0.0, 1.0);
  return x;
}

// `start` and a step along each axis, away from the nearer face.
std::vector<Vertex> simplexAt(Counted& cost, const Vertex& start, double step) {
  std::vector<Vertex> simplex = {start};
  for (std::size_t k = 0; k < start.x.size(); ++k) {
    Point x = start.x;
    x[k] += x[k] < 0.5 ? step : -step;
    simplex.push_back({x, cost(x)});
  }
  return simplex;
}

double widthOf(const std::vector<Vertex>& simplex) {
  double width = 0;
  for (const Vertex& v : simplex)
    for (std::size_t k = 0; k < v.x.size(); ++k)
      width = std::max(width, std::abs(v.x[k] - simplex[0].x[k]));
  return width;
}

// One step of Nelder and Mead (1965) on a simplex sorted by cost.
void stepSimplex(Counted& cost, std::vector<Vertex>& simplex) {
  const std::size_t n = simplex.size() - 1;
  Point center(n, 0.0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < n; ++k) center[k] += simplex[i].x[k] / static_cast<double>(n);
  Vertex& worst = simplex[n];
  const Point reflected = along(center, worst.x, -1);
  const double reflected_cost = cost(reflected);
  if (reflected_cost < simplex[0].cost) {
    const Point expanded = along(center, worst.x, -2);
    const double expanded_cost = cost(expanded);
    worst = expanded_cost < reflected_cost ? Vertex{expanded, expanded_cost}
                                           : Vertex{reflected, reflected_cost};
    return;
  }
  if (reflected_cost < simplex[n - 1].cost) {
    worst = {reflected, reflected_cost};
    return;
  }
  const bool outside = reflected_cost < worst.cost;
  const Point contracted = along(center, outside ? reflected : worst.x, 0.5);
  const double contracted_cost = cost(contracted);
  if (contracted_cost < std::min(reflected_cost, worst.cost)) {
    worst = {contracted, contracted_cost};
    return;
  }
  for (std::size_t i = 1; i <= n; ++i) {
    simplex[i].x = along(simplex[0].x, simplex[i].x, 0.5);
    simplex[i].cost = cost(simplex[i].x);
  }
}

void sortByCost(std::vector<Vertex>& simplex) {
  std::stable_sort(simplex.begin(), simplex.end(),
                   [](const Vertex& a, const Vertex& b) { return a.cost < b.cost; });
}

}  // namespace

std::vector<double> nelderMead(const TuneObjective& objective, std::span<const double> start,
                               int evaluations) {
  constexpr double kStep = 0.2, kCollapsed = 1e-3;
  PROBELAB_CHECK(evaluations > 0);
  Counted cost{objective, static_cast<std::size_t>(evaluations)};
  Vertex best{Point(start.begin(), start.end()), 0};
  best.cost = cost(best.x);
  while (!cost.spent()) {
    std::vector<Vertex> simplex = simplexAt(cost, best, kStep);
    sortByCost(simplex);
    while (!cost.spent() && widthOf(simplex) > kCollapsed) {
      stepSimplex(cost, simplex);
      sortByCost(simplex);
    }
    best = simplex[0];
  }
  return cost.best_after;
}

std::vector<double> randomSearch(const TuneObjective& objective, int evaluations, uint64_t seed) {
  PROBELAB_CHECK(evaluations > 0);
  Counted cost{objective, static_cast<std::size_t>(evaluations)};
  for (uint64_t i = 0; !cost.spent(); ++i) {
    Rng rng(seed, RngStream::tuning, 1, i);
    Point x(objective.keys.size());
    for (double& v : x) v = rng.nextDouble();
    cost(x);
  }
  return cost.best_after;
}

}  // namespace probelab
