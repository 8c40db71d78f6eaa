// SPDX-License-Identifier: GPL-3.0-or-later
// SCENE with --state and --camera, and how long to trace: shared by the commands that need them.
#pragma once

#include <optional>
#include <string>

#include "program.h"
#include "scene/scene.h"
#include "trace/path_tracer.h"

namespace CLI {
class App;
}

namespace probelab {

struct SceneOptions {
  std::string scene, state, camera;  // empty state and camera: the first
};
// SCENE and --state; with `camera` also --camera.
void addSceneOptions(CLI::App& app, SceneOptions& options, bool camera);

// Loads the scene in the wanted state and prints its warnings on stderr.
Scene loadScene(const SceneOptions& options, const Invocation& invocation);

struct SamplingOptions {
  std::optional<int> spp;
  std::optional<double> rel_error, seconds;
};
// --spp, --rel-error, --seconds; `fallback` is what the help names as the default.
void addSamplingOptions(CLI::App& app, SamplingOptions& options, const std::string& fallback);
// `fallback` where no option is given; several options: whichever is reached first.
SampleBudget sampleBudget(const SamplingOptions& options, const SampleBudget& fallback);

}  // namespace probelab
