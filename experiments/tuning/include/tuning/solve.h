// SPDX-License-Identifier: GPL-3.0-or-later
// Multi-start Levenberg-Marquardt (Ceres) on a TuneObjective, and what can be told at the optimum.
// All x are coordinates in [0, 1] of the objective's keys.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tuning/objective.h"

namespace probelab {

struct SolveSettings {
  int starts = 16;      // run to the end: the base's values and the best of a seeded coarse set
  int candidates = 64;  // of the coarse set
  int iterations = 50;  // of each start
  uint64_t seed = 1;
};

struct SolveStep {
  std::vector<double> x;
  double cost = 0;
};
struct SolvePath {
  std::vector<SolveStep> steps;  // the start first; those that lowered the cost
  int evaluations = 0;
  std::string ended;  // why, in a few words
};

struct SolveResult {
  std::vector<double> x;
  double cost = 0;
  int best = 0;                  // path of Ceres that ended lowest
  std::vector<SolvePath> paths;  // the base's first; the last one is the polish
  int evaluations = 0;           // of residuals, all in all; `gradients` of them with derivatives
  int gradients = 0;
  std::vector<double> best_after;  // [evaluation]: lowest cost so far, in the order they were done
  // At the optimum:
  std::vector<double> singular_values;      // of the Jacobian by x, descending
  std::vector<double> standard_deviations;  // [key], in the key's units; infinite where unbound
  std::vector<std::vector<double>> correlation;
  // [key]: relative rise of the cost for 0.1 of the range, the mean of the sides within it.
  std::vector<double> sensitivity;
};

SolveResult solveTuning(const TuneObjective& objective, const SolveSettings& settings,
                        const std::function<void(double)>& progress = {});

// Derivative-free searches for comparison: lowest cost so far after each evaluation.
std::vector<double> nelderMead(const TuneObjective& objective, std::span<const double> start,
                               int evaluations);
std::vector<double> randomSearch(const TuneObjective& objective, int evaluations, uint64_t seed);

// Costs and errors over (normal_bias, view_bias) on a regular grid of `count` values a side, both
// ends included; other values as in `params`. [view][normal]; errors are means over the states by
// their weights (nrmse: root of the mean square).
struct BiasMap {
  int count = 0;
  double normal_high = 0, view_high = 0;  // both from 0
  std::vector<double> cost, nrmse, light_leak;
};
BiasMap scanBiases(const TuneObjective& objective, const Params& params, int count,
                   double normal_high, double view_high,
                   const std::function<void(double)>& progress = {});

}  // namespace probelab
