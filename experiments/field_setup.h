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
#include "proxy_setup.h"
#include "scene_options.h"
#include "trace/embree_scene.h"
#include "trace/reachability.h"

namespace probelab {

// A scene and a device to run fields in it. Not movable: fields refer to its members.
struct SceneSetup {
  SceneSetup(const SceneOptions& scene_options, const Invocation& invocation);
  SceneSetup(const SceneSetup&) = delete;

  Scene scene;
  Provenance provenance;
  EmbreeScene embree;
  GpuContext gpu;
  Reachability reachability;
};

// How a field is made beyond its parameters.
struct FieldPlan {
  const FieldOptions& options;
  uint64_t seed = 0;
  std::string cache = {};             // folder of layouts that took long to make; empty: none
  const ProxySetup* proxy = nullptr;  // what probe rays see; null: the scene
  bool accumulate = true;
  uint64_t working_set_bytes = FieldSettings{}.working_set_bytes;
};

// A fresh field; `setup` and the proxy must outlive it.
std::unique_ptr<ProbeField> makeField(SceneSetup& setup, const Params& params,
                                      const FieldPlan& plan);

// A scene with a fresh field in it.
struct FieldSetup : SceneSetup {
  FieldSetup(const SceneOptions& scene_options, const FieldOptions& options,
             const Invocation& invocation)
      : FieldSetup(resolveParams(options), scene_options, options, invocation) {}

  Params params;
  std::unique_ptr<ProxySetup> proxy;  // empty without --ray-proxy
  std::unique_ptr<ProbeField> field;

  // What probe rays see.
  const Scene& probeScene() const { return proxy ? proxy->proxy.scene : scene; }
  const EmbreeScene& probeEmbree() const { return proxy ? proxy->embree : embree; }

 private:
  FieldSetup(Params wanted, const SceneOptions& scene_options, const FieldOptions& options,
             const Invocation& invocation);
};

// Fitted values that were put on a field, and what they were fitted to.
struct ValuesUse {
  std::string file, scene, state, params;
};
Json toJson(const std::optional<ValuesUse>& values);  // null without
std::string formatValues(const Json& values);         // of what toJson gives

// What running the field took.
struct FieldRun {
  int updates = 0;
  bool stopped_early = false;                           // by variability_threshold
  std::optional<ConvergeReport> converged;              // empty when temporal
  std::optional<ValuesUse> values;                      // with --values
  std::vector<double> update_ms;                        // wall time, [update]
  std::map<std::string, std::vector<double>> stage_ms;  // "trace" -> [update]
};

// Runs the field in the mode that the options name, with progress; `on_update` after each update.
// Last come the values of --values; ones that do not fit are refused before the first update.
FieldRun runField(ProbeField& field, const FieldOptions& options, const Invocation& invocation,
                  const UpdateCallback& on_update = {});

// Without the first updates, in which caches are cold and pipelines are built.
std::vector<double> afterWarmUp(const std::vector<double>& times);

// {"name": ..., and every key with its value}.
Json toJson(const Params& params);

}  // namespace probelab
