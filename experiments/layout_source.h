// SPDX-License-Identifier: GPL-3.0-or-later
// The layout that the options of a command name: read from a file, or made by a strategy. What took
// long to make is kept in the cache under a hash of everything that it depends on.
#pragma once

#include <functional>
#include <string>

#include "ddgi/layout.h"
#include "ddgi/params.h"
#include "field_options.h"
#include "scene/scene.h"
#include "trace/embree_scene.h"
#include "trace/reachability.h"

namespace probelab {

struct PlacementScene {
  const Scene& scene;
  const EmbreeScene& embree;
  const Reachability& reachability;
};

// What a strategy may see: the scene in its first train state, without the held-out states. So no
// layout depends on the state that is evaluated.
Scene trainScene(const Scene& scene);

// The train receivers of a budget: 50 a probe, 4,096 at least.
int trainReceivers(int probes);

// `params` are those that the layout will be read with. With a folder `cache` a layout that took
// more than a second is kept there; a damaged entry is a miss.
ProbeLayout obtainLayout(const PlacementScene& of, const FieldOptions& options,
                         const Params& params, uint64_t seed, const std::string& cache,
                         const std::function<void(double)>& progress = {});

}  // namespace probelab
