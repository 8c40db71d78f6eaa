// SPDX-License-Identifier: GPL-3.0-or-later
// `bench --sweep`: is an update's cost linear in probes and in rays?
#pragma once

#include <span>
#include <string>

#include "field_setup.h"
#include "json.h"

namespace probelab {

// y = a + b x by least squares of the relative residuals (y's own size is their weight). R^2 is of
// the plain residuals. At least two points with y > 0 and different x.
struct LineFit {
  double a = 0, b = 0, r2 = 0, largest_relative_residual = 0;
};
LineFit fitLine(std::span<const double> x, std::span<const double> y);

// {"probes": {"points": [{"probes", "rays", "update_ms"}], "fits": {"update" or a stage: {a_ms,
// b_us, r2, largest_residual}}}, "rays": the same}: 256 to 32,768 probes of 64 rays, 16 to 1,024
// rays of 512 probes. b is microseconds a probe, or a ray of each probe. Medians of updates as an
// engine runs them, in rounds over all sizes. `most_probes`: where the sweep ends; rays end at its
// 32nd.
Json runSweep(SceneSetup& setup, const Params& params, const FieldOptions& options, int most_probes,
              const Invocation& invocation);

std::string formatSweep(const Json& sweep);

}  // namespace probelab
