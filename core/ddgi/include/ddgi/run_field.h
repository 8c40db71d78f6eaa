// SPDX-License-Identifier: Apache-2.0
// The two ways to run a field: `converged` for studies, `temporal` as an engine does it.
#pragma once

#include <functional>
#include <vector>

#include "ddgi/probe_field.h"

namespace probelab {

struct ConvergeOptions {
  double tolerance =
      1e-4;          // relative change still to come when the bounce series counts as settled
  int average = 64;  // updates in the plain average
  int max_burn_in = 4096;
};

struct ConvergeReport {
  int burn_in_updates = 0;  // with one set of directions, until settled
  int mixing_updates = 0;   // with new directions, until those of the burn-in are forgotten
  int average_updates = 0;
  bool settled = true;     // `remaining` is small; a coarse format may stall the series before
  double contraction = 0;  // of the bounce series, per update
  double remaining = 0;    // estimated relative change still to come at the end of the burn-in
  int updates() const { return burn_in_updates + mixing_updates + average_updates; }
};

// Called after every update with the updates done and, where known, the total (0: not yet known).
using UpdateCallback = std::function<void(int done, int total)>;

// Burn-in without hysteresis and with unchanging directions, so that the bounce series is a plain
// geometric one and its end can be told from noise; then updates with new directions each, first
// until the burn-in's own error has shrunk to a tenth, then `average` of them for the mean in
// linear irradiance, while the moments are averaged from the first new direction on. The field must
// be fresh and have FieldSettings::accumulate. An update is unbiased given the one before (linear
// averaging of probes), so the mean is too.
ConvergeReport convergeField(ProbeField& field, const ConvergeOptions& options,
                             const UpdateCallback& on_update = {});

// Hysteresis of a new field's update, counted from 0. The first one writes without (there is no
// history). With Params::warm_up so do that many: bounces come up by themselves there, each update
// a step of their series, where history would hold every step back. Then the field is the mean of
// all updates from the last of these on, until that has as much history as Params::hysteresis.
float temporalHysteresis(const Params& params, int update);

// Up to `updates` updates with temporalHysteresis. Stops when the field's variability falls below
// Params::variability_threshold. Returns the updates done.
int runTemporal(ProbeField& field, int updates, const UpdateCallback& on_update = {});

}  // namespace probelab
