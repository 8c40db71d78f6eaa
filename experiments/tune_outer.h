// SPDX-License-Identifier: GPL-3.0-or-later
// Search over keys that change the atlases. Each value needs fields of its own, so it takes few
// evaluations and no derivatives.
#pragma once

#include "tune_run.h"

namespace probelab {

// Compass search from `tuned`: a quarter of each key's range up and down, halved where nothing
// helps. An evaluation runs the fields and solves for the inner keys from those of the best so far.
// The best counts only if the fields, run again with all of its values, have a lower cost.
void searchOuter(TuneFields& fields, const TuneProblem& problem, const TuneSettings& settings,
                 Tuned& tuned, const Invocation& invocation);

}  // namespace probelab
