// SPDX-License-Identifier: GPL-3.0-or-later
// The scenes of a tuning: all that stays the same while parameters change.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ddgi/layout.h"
#include "field_options.h"
#include "json.h"
#include "program.h"
#include "proxy_setup.h"
#include "scene/scene.h"
#include "trace/embree_scene.h"
#include "trace/reachability.h"
#include "trace/receivers.h"
#include "truth.h"

namespace probelab {

struct TuneState {
  Scene scene;            // in this state
  bool tuned_on = false;  // else its light is held out
  Receivers receivers;
};

// Not movable: fields refer to its members.
struct TuneScene {
  explicit TuneScene(Scene loaded);
  TuneScene(const TuneScene&) = delete;

  Scene scene;
  EmbreeScene embree;
  Reachability reachability;
  std::unique_ptr<ProxySetup> proxy;  // empty without --ray-proxy
  ProbeLayout layout;
  std::vector<TuneState> states;  // those that are tuned on first

  std::vector<Vec3f> cameras() const;
};

struct TuneSceneOptions {
  std::string state;      // the only one to tune on; empty: all train states
  std::string receivers;  // a file with truth, of one scene and state; empty: traced or cached
  FieldOptions field;
  TruthOptions truth;
};

// Loads the scene, its layout (made for `params`) and the truth of every state; states to tune on
// that light no train receiver are left out with a note. Throws InputError where none remains, or
// where receivers do not suffice for `keys` parameters.
std::unique_ptr<TuneScene> loadTuneScene(const std::string& path, const TuneSceneOptions& options,
                                         const Params& params, std::size_t keys,
                                         const Invocation& invocation);

// One state of one scene: what a field is run for.
struct TunePart {
  const TuneScene* scene = nullptr;
  const TuneState* state = nullptr;
};
using TuneScenes = std::vector<std::unique_ptr<TuneScene>>;
// Those tuned on, or all of them; without the scene `except`.
std::vector<TunePart> tuneParts(const TuneScenes& scenes, bool only_tuned_on,
                                const TuneScene* except = nullptr);

}  // namespace probelab
