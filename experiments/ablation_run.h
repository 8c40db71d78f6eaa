// SPDX-License-Identifier: GPL-3.0-or-later
// Runs the rows of an ablation on one scene, device, seed and truth.
#pragma once

#include <string>
#include <vector>

#include "ablation.h"
#include "evaluation.h"
#include "field_setup.h"
#include "json.h"
#include "program.h"

namespace probelab {

// {"rounds": of timing, "ablation": [a row each, the base first], "ablation_skipped": [{row,
// why}]}.
//
// A row: row, about, set, probes {stored, active}, rays_per_probe, memory, ray_proxy, error, speed
// {update_ms, the stages, query_ns_per_point: medians over the rounds}, stability, updates, and
// "ratios" to the base {nrmse, update_ms, trace_ms, query_ns_per_point} with
// "same_estimates": true where every receiver's estimate has the base's bits.
//
// Errors are scored once: they are deterministic. Times are taken afterwards in rounds over all
// rows, of updates as an engine runs them (with hysteresis, without averages), and ratios within a
// round, so that whatever else the machine does meets all rows alike.
Json runAblation(SceneSetup& setup, const std::vector<AblationCase>& cases,
                 const Receivers& receivers, ScoredSplit split, const Invocation& invocation);

// The table and what its rows are.
std::string formatAblation(const Json& result);

}  // namespace probelab
