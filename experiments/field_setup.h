// SPDX-License-Identifier: GPL-3.0-or-later
// From options to a probe field that has been run: for render, evaluate and bench.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ddgi/run_field.h"
#include "field_options.h"
#include "gpu/context.h"
#include "json.h"
#include "program.h"
#include "provenance.h"
#include "scene_options.h"
#include "trace/embree_scene.h"
#include "trace/reachability.h"

namespace probelab {

// A scene with a fresh field in it. Not movable: the field refers to its neighbours.
struct FieldSetup {
  FieldSetup(const SceneOptions& scene_options, const FieldOptions& options,
             const Invocation& invocation);
  FieldSetup(const FieldSetup&) = delete;

  Params params;
  Scene scene;
  Provenance provenance;
  EmbreeScene embree;
  GpuContext gpu;
  Reachability reachability;
  std::unique_ptr<ProbeField> field;
};

// What running the field took.
struct FieldRun {
  int updates = 0;
  std::optional<ConvergeReport> converged;              // empty when temporal
  std::vector<double> update_ms;                        // wall time, [update]
  std::map<std::string, std::vector<double>> stage_ms;  // "trace" -> [update]
};

// Runs the field in the mode that the options name, with progress; `on_update` after each update.
FieldRun runField(ProbeField& field, const FieldOptions& options, const Invocation& invocation,
                  const UpdateCallback& on_update = {});

// Without the first updates, in which caches are cold and pipelines are built.
std::vector<double> afterWarmUp(const std::vector<double>& times);

// {"name": ..., and every key with its value}.
Json toJson(const Params& params);

}  // namespace probelab
