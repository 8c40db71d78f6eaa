// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/scattered.h"

#include "base/error.h"
#include "placement/corner_weights.h"

namespace probelab {

std::vector<StrategyOption> scatteredOptions(std::vector<StrategyOption> own) {
#ifdef PROBELAB_WITH_CGAL
  const char* interpolants = "knn | tetrahedra | natural";
#else
  const char* interpolants = "knn | natural";
#endif
  own.push_back({"interpolant", "knn", interpolants,
                 "what weighs the probes: k nearest, Delaunay tetrahedra, natural neighbours"});
  own.push_back({"k", "8", "1 .. 64", "probes that count at a place, with knn"});
  own.push_back({"visibility", "on", "on | off", "only probes that a place sees count there"});
  own.push_back({"cells", "2", "0.5 .. 8", "voxels of the query's index, a mean spacing"});
  return own;
}

ProbeLayout scatterProbes(const FreeSpace& space, std::vector<Vec3f> positions,
                          std::vector<uint8_t> pinned) {
  const PlacementInput& input = space.input();
#ifdef PROBELAB_WITH_CGAL
  const int choice = choiceOption(input, "interpolant", {"knn", "natural", "tetrahedra"});
#else
  const int choice = choiceOption(input, "interpolant", {"knn", "natural"});
#endif
  CornerSettings settings;
  settings.k = integerOption(input, "k", 1, 64);
  settings.visibility = choiceOption(input, "visibility", {"on", "off"}) == 0;
  const Lattice corners =
      influenceCorners(input.scene.bounds, space.spacing(static_cast<int>(positions.size())),
                       numberOption(input, "cells", 0.5, 8));
  CornerWeights weights;
  Interpolant interpolant = Interpolant::knn;
  if (choice == 0) {
    weights = knnWeights(corners, positions, space, settings);
  } else if (choice == 1) {
    interpolant = Interpolant::natural;
    weights = naturalWeights(corners, positions, space, settings);
#ifdef PROBELAB_WITH_CGAL
  } else {
    interpolant = Interpolant::tetrahedra;
    weights = tetrahedraWeights(corners, positions, space, settings);
#endif
  }
  ProbeLayout layout = scatteredLayout(interpolant, std::move(positions), input.scene.bounds,
                                       corners, std::move(weights));
  layout.pinned = std::move(pinned);
  return layout;
}

}  // namespace probelab
