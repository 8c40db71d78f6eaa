// SPDX-License-Identifier: GPL-3.0-or-later
// Placement strategies: scene and budget in, ProbeLayout out. A strategy is one file that defines a
// Strategy; strategies.cpp lists them.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "ddgi/layout.h"
#include "scene/scene.h"
#include "trace/embree_scene.h"
#include "trace/reachability.h"

namespace probelab {

// The box that a lattice fills.
enum class LatticeBox {
  free_space,  // the reachable free space, shrunk by 0.05 spacing
  bounds,      // the scene's bounds, outermost probes on them
};

struct PlacementInput {
  const Scene& scene;
  const EmbreeScene& embree;
  const Reachability& reachability;
  int probes = 0;  // budget N
  uint64_t seed = 0;
  LatticeBox box = LatticeBox::free_space;
  double vertical = 1;  // spacing along y over that along x and z
};

struct Strategy {
  std::string name;
  std::string description;  // one line for help pages
  ProbeLayout (*place)(const PlacementInput& input);
};

std::span<const Strategy> strategies();

// Runs the named strategy and fills ProbeLayout::strategy and build_s. Throws InputError for an
// unknown name (with the nearest), a budget below 1 or above 2^24, or `vertical` outside 0.25 .. 8.
ProbeLayout placeProbes(const std::string& strategy, const PlacementInput& input);

}  // namespace probelab
