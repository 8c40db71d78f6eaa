// SPDX-License-Identifier: GPL-3.0-or-later
// The lighting states that a layout is trained under: the scene's own train states, and others of
// the same kinds drawn from the scene, so that no place stays dark in all of them.
#pragma once

#include <string>
#include <vector>

#include "scene/scene.h"
#include "shared/light.h"
#include "trace/embree_scene.h"
#include "trace/reachability.h"

namespace probelab {

inline constexpr std::size_t kMostStates = 128;

struct Lighting {
  std::string name;
  bool own = false;  // a state of the scene; else generated
  std::vector<LightData> lights;
  float sky_scale = 1;  // Sky::scale
};

// The scene's states of `split`, then `generated` others. Kinds follow the scene: lamps (one lamp a
// state, at points of the reachable free space far from each other), suns (directions from which
// the reachable space can be seen) and the sky alone; a scene without lights of its own gets lamps.
// No more than kMostStates in all.
std::vector<Lighting> trainingLighting(const Scene& scene, const EmbreeScene& embree,
                                       const Reachability& reachability, Split split, int generated,
                                       uint64_t seed);

}  // namespace probelab
