// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene_options.h"

#include <CLI/CLI.hpp>

#include "scene/load.h"

namespace probelab {

void addSceneOptions(CLI::App& app, SceneOptions& options, bool camera) {
  addSceneArgument(app, options.scene);
  app.add_option("--state", options.state, "lighting state of the scene (default: its first)")
      ->type_name("NAME")
      ->group("Scene");
  if (!camera) return;
  app.add_option("--camera", options.camera, "camera of the scene (default: its first)")
      ->type_name("NAME")
      ->group("Scene");
}

Scene loadScene(const SceneOptions& options, const Invocation& invocation) {
  Scene scene = loadScene(options.scene);
  if (!options.state.empty()) scene = withState(scene, options.state);
  for (const std::string& warning : scene.warnings) note(invocation, "warning: {}", warning);
  return scene;
}

void addSamplingOptions(CLI::App& app, SamplingOptions& options, const std::string& fallback) {
  const char* group = "Sampling (whichever is reached first)";
  app.add_option("--spp", options.spp,
                 "stop at this many samples a pixel or point (rounded up to whole passes)")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->group(group);
  app.add_option("--rel-error", options.rel_error,
                 "stop at this relative standard error, 0.02 is 2 % (default: " + fallback + ")")
      ->type_name("E")
      ->check(checkPositive)
      ->group(group);
  app.add_option("--seconds", options.seconds,
                 "stop after this many seconds; the result then depends on the machine")
      ->type_name("S")
      ->check(checkPositive)
      ->group(group);
}

SampleBudget sampleBudget(const SamplingOptions& options, const SampleBudget& fallback) {
  if (!options.spp && !options.rel_error && !options.seconds) return fallback;
  SampleBudget budget;
  budget.spp = static_cast<uint32_t>(options.spp.value_or(0));
  budget.rel_error = options.rel_error.value_or(0);
  budget.seconds = options.seconds.value_or(0);
  return budget;
}

}  // namespace probelab
