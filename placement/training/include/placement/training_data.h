// SPDX-License-Identifier: GPL-3.0-or-later
// What a Training holds once it is traced.
#pragma once

#include <span>
#include <vector>

#include "placement/patch_cache.h"
#include "placement/probe_bake.h"
#include "placement/training.h"
#include "trace/receivers.h"

namespace probelab {

struct Training::Data {
  const Scene& scene;
  const EmbreeScene& embree;
  const Reachability& reachability;
  TrainingSettings settings;
  std::unique_ptr<PatchCache> patches;
  std::vector<Receiver> receivers;  // of train blocks only; areas sum to 1
  std::vector<float> truth;         // [receiver][state], irradiance / pi, luminance
  std::vector<double> power;        // [state]: sum of area * truth^2
  std::vector<double> mean;         // [state]: sum of area * truth
  uint64_t evaluations = 0;

  bool traced() const { return patches != nullptr; }
  std::size_t stateCount() const { return power.size(); }
};

// Irradiance / pi (luminance) at points, [point][state], with settings.receiver_rays; the random
// streams of the points count from `first_stream`, the receivers' own from 0.
std::vector<float> gatherTruth(const Training::Data& data, std::span<const Receiver> points,
                               uint64_t first_stream);

// nrmse^2 of estimates [receiver][state] (irradiance / pi) under each state; 0 where it is unlit.
std::vector<double> squaredErrors(const Training::Data& data, std::span<const float> estimates);

// Estimates of a layout, [receiver][state]: the shared query on baked probes.
std::vector<float> estimateLayout(const Training::Data& data, const ProbeLayout& layout,
                                  const Params& params);
// The same on probes that are baked already.
std::vector<float> estimateLayout(const Training::Data& data, const ProbeLayout& layout,
                                  const Params& params, const LayoutBake& bake);

}  // namespace probelab
