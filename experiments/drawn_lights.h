// SPDX-License-Identifier: GPL-3.0-or-later
// How a layout answers lights that nothing was made for: lamps, suns and the sky, drawn from the
// scene as those that strategies train under, but others. One lighting state says how a layout
// does under that one light; dozens say how it does under light that may be anywhere.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ddgi/layout.h"
#include "ddgi/params.h"
#include "json.h"
#include "layout_source.h"
#include "metrics/error.h"
#include "placement/reading_bound.h"

namespace probelab {

struct DrawnLight {
  std::string kind;  // lamp, sun, sky
  ErrorMetrics error;
};

struct DrawnLightsScore {
  int receivers = 0;  // all of them held-out
  std::vector<DrawnLight> lights;
  std::optional<ReadingBound> reading;  // what better weights of the same probes could do
};

// Truth and probes are gathered from the same patches (placement/training.h), and the shared query
// reads the probes in C++: no feedback, no storage formats. Lights that reach no receiver are left
// out. Throws InputError where there are no held-out receivers, or no light reaches one.
DrawnLightsScore scoreDrawnLights(const PlacementScene& of, const ProbeLayout& layout,
                                  const Params& params, int lights, uint64_t seed);

// {"lights", "receivers", "nrmse": root of the mean of nrmse^2, "smape", "light_leak",
// "shadow_leak": means, "each": [{"kind", "nrmse", ...}], "reading": null or {"nrmse", "unseen",
// "seen"}}.
Json toJson(const DrawnLightsScore& score);

}  // namespace probelab
