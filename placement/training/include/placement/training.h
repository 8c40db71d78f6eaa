// SPDX-License-Identifier: GPL-3.0-or-later
// What strategies that read truth may know: train receivers with their irradiance under many
// lighting states, and the score of any layout against it.
//
// Light transport is linear, so geometry is traced once for all lights: surfaces are sampled by
// patches, patches gather from each other until the bounces have settled, and receivers and probes
// gather from the patches.
#pragma once

#include <cstdint>
#include <memory>

#include "ddgi/layout.h"
#include "ddgi/params.h"
#include "scene/scene.h"
#include "trace/embree_scene.h"
#include "trace/reachability.h"

namespace probelab {

struct TrainingSettings {
  int receivers = 6400;        // all of them in blocks of `split`
  int lights = 60;             // generated states, beside the scene's own of `split`
  Split split = Split::train;  // held-out ones check a search, they never steer it
  uint64_t seed = 0;
  int receiver_rays = 256;  // that the truth at each of them is gathered with
  int lamps_each = 8;       // LightingPlan::lamps_each
  bool own_lights = true;   // LightingPlan::own
};

class Training {
 public:
  // References are kept.
  Training(const Scene& scene, const EmbreeScene& embree, const Reachability& reachability,
           const TrainingSettings& settings);
  ~Training();
  Training(const Training&) = delete;

  // Root of the mean over lights of nrmse^2 of the layout read with these parameters, on the train
  // receivers: probes hold traced irradiance and moments, without feedback. `own_only`: over the
  // scene's own states alone. Counts as one evaluation.
  double score(const ProbeLayout& layout, const Params& params, bool own_only = false);
  uint64_t evaluations() const;
  const TrainingSettings& settings() const;

  struct Data;
  Data& data();  // traced at the first call; placement/training_data.h

 private:
  std::unique_ptr<Data> data_;
};

}  // namespace probelab
