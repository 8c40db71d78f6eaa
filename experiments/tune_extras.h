// SPDX-License-Identifier: GPL-3.0-or-later
// What `tune` shows besides its result: the map of both biases, and other searches on the same
// cost.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "json.h"
#include "tune_run.h"
#include "tune_scores.h"

namespace probelab {

struct BiasMapResult {
  Json json;        // {size, held, presets: [{name, normal_bias, view_bias}]}
  std::string csv;  // normal_bias,view_bias,cost,nrmse,light_leak; a row each
};

// Over the fields of the tuned parameters, held still; the other values are the tuned ones.
// Positions of every preset and of both settings are in the JSON.
BiasMapResult mapBiases(const HeldFields& held, const Params& from, const Params& tuned, int size,
                        const Invocation& invocation);

// Lowest cost of the first field's objective after so many evaluations, where it fell:
// {name: [[evaluations, cost]]}, for Levenberg-Marquardt from the values of `from` alone, for the
// multi-start solution, and, with `evaluations`, for Nelder-Mead from the same values and random
// search. An evaluation with derivatives counts as 1 + parameters.
Json compareSearches(const HeldFields& held, const Params& from, const SolveResult& first,
                     int evaluations, uint64_t seed);

}  // namespace probelab
