// SPDX-License-Identifier: GPL-3.0-or-later
// Texel values fitted to one light, and what they do at held-out receivers under it and under the
// scene's other lights.
#pragma once

#include <string>
#include <vector>

#include "json.h"
#include "metrics/bootstrap.h"
#include "metrics/error.h"
#include "tune_fields.h"
#include "tune_scene.h"
#include "tuning/value_fit.h"
#include "tuning/values_file.h"

namespace probelab {

struct ValuesScore {
  std::string state;
  bool fitted = false;  // else its gains come from another light
  ErrorReport train_before, train_after, heldout_before, heldout_after;  // by receivers
  std::optional<RatioInterval> gain;  // held-out nrmse before over after
};

struct FittedValues {
  TexelValues values;
  ValueFit fit;
  std::vector<ValuesScore> scores;  // a state each, the fitted one first
};

// Fitted on the train receivers of the scene's first state, of the field under `params`.
FittedValues fitFieldValues(TuneFields& fields, const TuneScene& scene, const Params& params);

// {state, texels, iterations, scores: [{state, fitted, train, heldout {before, after}, gain}]}.
Json toJson(const FittedValues& fitted);
std::string formatValues(const FittedValues& fitted);

}  // namespace probelab
