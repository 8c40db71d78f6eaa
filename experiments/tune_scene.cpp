// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_scene.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "base/error.h"
#include "base/progress.h"
#include "evaluation.h"
#include "layout_source.h"
#include "scene_options.h"

namespace probelab {
namespace {

// Names of the states, those to tune on first. Without any train state all of them are.
std::vector<std::pair<std::string, bool>> orderedStates(const Scene& scene,
                                                        const std::string& only) {
  if (!only.empty()) withState(scene, only);  // throws where there is none of that name
  const bool has_train =
      std::any_of(scene.states.begin(), scene.states.end(),
                  [](const LightingState& state) { return state.split == Split::train; });
  std::vector<std::pair<std::string, bool>> states;
  for (const LightingState& state : scene.states)
    states.emplace_back(
        state.name, only.empty() ? !has_train || state.split == Split::train : state.name == only);
  std::stable_partition(states.begin(), states.end(),
                        [](const auto& state) { return state.second; });
  return states;
}

void checkReceivers(const TuneState& state, std::size_t keys) {
  std::size_t train = 0;
  for (const Receiver& r : state.receivers.points) train += r.split == Split::train;
  const std::size_t heldout = state.receivers.points.size() - train;
  if (train <= keys || heldout < 2)
    throwInput(
        "{}: {} train and {} held-out receivers are too few to tune {} parameters on and to score "
        "them; raise --count",
        state.scene.path, train, heldout, keys);
}

bool lightsTrainReceivers(const TuneState& state) {
  return meanReference(state.receivers, ScoredSplit::train) > 0;
}

// A user who names no state should hear what it was tuned on.
void noteStates(const TuneScene& loaded, const std::vector<std::string>& unlit,
                const TuneSceneOptions& options, const Invocation& invocation) {
  const Scene& scene = loaded.scene;
  if (!unlit.empty())
    note(invocation, "{}: left out, since no train receiver gets light in it: {}", scene.name,
         fmt::join(unlit, ", "));
  if (options.state.empty() && !scene.states.empty() &&
      std::ranges::all_of(scene.states, [](const auto& s) { return s.split == Split::heldout; }))
    note(invocation, "{}: no state is a train state, so held-out ones are tuned on", scene.name);
}

// Throws InputError where nothing is left to tune on.
void checkTunedOn(const TuneScene& loaded, const std::vector<std::string>& unlit,
                  const std::string& path) {
  if (!loaded.states.empty() && loaded.states.front().tuned_on) return;
  if (unlit.empty())
    throwInput(
        "{}: '{}', the state of the receivers, is held out and would not be tuned on; name it by "
        "--state to do so",
        path, loaded.scene.state);
  throwInput(
      "{}: no train receiver gets light in state {}, so there is no error to tune on; add a light, "
      "or choose another --state",
      path, fmt::join(unlit, ", "));
}

ProbeLayout loadLayout(const TuneScene& of, const TuneSceneOptions& options, const Params& params,
                       const Invocation& invocation) {
  Progress progress("layout", 1, invocation.common.quiet);
  ProbeLayout layout = obtainLayout({of.scene, of.embree, of.reachability}, options.field, params,
                                    invocation.common.seed, invocation.common.cache,
                                    [&](double done) { progress.update(done); });
  progress.finish();
  return layout;
}

}  // namespace

TuneScene::TuneScene(Scene loaded)
    : scene(std::move(loaded)), embree(scene), reachability(findReachable(scene, embree)) {}

std::vector<Vec3f> TuneScene::cameras() const {
  std::vector<Vec3f> positions;
  for (const Camera& camera : scene.cameras) positions.push_back(camera.position);
  return positions;
}

std::unique_ptr<TuneScene> loadTuneScene(const std::string& path, const TuneSceneOptions& options,
                                         const Params& params, std::size_t keys,
                                         const Invocation& invocation) {
  SceneOptions of;
  of.scene = path, of.state = options.state;
  auto loaded = std::make_unique<TuneScene>(loadScene(of, invocation));
  std::vector<std::string> unlit;
  for (const auto& [name, tuned_on] : orderedStates(loaded->scene, options.state)) {
    const bool from_file = !options.receivers.empty();
    if (from_file && name != loaded->scene.state) continue;  // there is truth for one state alone
    TuneState state{withState(loaded->scene, name), tuned_on, {}};
    if (from_file)
      state.receivers = readReceivers(options.receivers, state.scene);
    else
      state.receivers =
          obtainTruth(options.truth, state.scene, loaded->embree, loaded->reachability, invocation)
              .receivers;
    checkReceivers(state, keys);
    if (tuned_on && !lightsTrainReceivers(state))
      unlit.push_back(name);
    else
      loaded->states.push_back(std::move(state));
  }
  checkTunedOn(*loaded, unlit, path);
  noteStates(*loaded, unlit, options, invocation);
  loaded->proxy = makeProxySetup(loaded->scene, loaded->embree, options.field.ray_proxy_m,
                                 invocation.common.seed);
  loaded->layout = loadLayout(*loaded, options, params, invocation);
  return loaded;
}

std::vector<TunePart> tuneParts(const TuneScenes& scenes, bool only_tuned_on,
                                const TuneScene* except) {
  std::vector<TunePart> parts;
  for (const auto& scene : scenes)
    for (const TuneState& state : scene->states)
      if (scene.get() != except && (state.tuned_on || !only_tuned_on))
        parts.push_back({scene.get(), &state});
  return parts;
}

}  // namespace probelab
