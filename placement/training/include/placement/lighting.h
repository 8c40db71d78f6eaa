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

struct LightingPlan {
  Split split = Split::train;
  bool own = true;     // the scene's states of `split` are among them
  int generated = 0;   // states beside these
  int lamps_each = 1;  // in every other generated state of lamps; one in the rest
  uint64_t seed = 0;
};

// The scene's states of the split, if they are wanted, then generated others. Kinds follow the
// scene: lamps (at points of the reachable free space far from each other, those of one state too),
// suns (one a state, directions from which the reachable space can be seen) and the sky alone; a scene without lights
// of its own gets lamps. Fewer are generated where there would be more than kMostStates in all;
// throws InputError where the scene's own are.
//
// What a lamp lights brightly is small, so dozens of lamps one by one leave most of the walls
// to chance, and layouts fit the places where lamps happened to stand. Lamps that share a state but
// stand apart are nearly as good as states of their own, because errors are local to their bright
// spots; but rooms have to be dark in some states too.
std::vector<Lighting> trainingLighting(const Scene& scene, const EmbreeScene& embree,
                                       const Reachability& reachability, const LightingPlan& plan);

}  // namespace probelab
