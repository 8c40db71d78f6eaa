// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/scattered.h"

#include <fmt/ranges.h>

#include <array>

#include "base/error.h"
#include "placement/corner_weights.h"

namespace probelab {
namespace {

constexpr std::array kInterpolants = {
    Interpolant::maxent,
    Interpolant::knn,
    Interpolant::natural,
#ifdef PROBELAB_WITH_CGAL
    Interpolant::tetrahedra,
#endif
};

std::vector<std::string> names() {
  std::vector<std::string> all;
  for (const Interpolant interpolant : kInterpolants) all.push_back(interpolantName(interpolant));
  return all;
}

std::string interpolantNames() { return fmt::format("{}", fmt::join(names(), " | ")); }

}  // namespace

std::vector<StrategyOption> scatteredOptions(std::vector<StrategyOption> own) {
  own.push_back({"interpolant", "maxent", interpolantNames(),
                 "what weighs the probes: maximum entropy, k nearest, natural neighbours, Delaunay "
                 "tetrahedra"});
  own.push_back(
      {"k", "0", "0 .. 64", "probes that count at a place; 0: 16 with maxent, 8 with knn"});
  own.push_back({"sharpness", "10", "0.01 .. 100",
                 "with maxent: of the kernel; low ones smooth, high ones tend to tetrahedra"});
  own.push_back({"visibility", "on", "on | off", "only probes that a place sees count there"});
  own.push_back({"cells", "2", "0.5 .. 8", "voxels of the query's index along one mean spacing"});
  return own;
}

ProbeLayout scatterProbes(const FreeSpace& space, std::vector<Vec3f> positions,
                          std::vector<uint8_t> pinned) {
  const PlacementInput& input = space.input();
  const Interpolant interpolant =
      kInterpolants[static_cast<std::size_t>(choiceOption(input, "interpolant", names()))];
  CornerSettings settings;
  settings.k = integerOption(input, "k", 0, 64);
  if (settings.k == 0) settings.k = interpolant == Interpolant::maxent ? 16 : 8;
  const double sharpness = numberOption(input, "sharpness", 0.01, 100);
  if (interpolant == Interpolant::maxent) settings.sharpness = sharpness;
  settings.visibility = choiceOption(input, "visibility", {"on", "off"}) == 0;
  const Lattice corners =
      influenceCorners(input.scene.bounds, space.spacing(static_cast<int>(positions.size())),
                       numberOption(input, "cells", 0.5, 8));
  CornerWeights weights;
  if (interpolant == Interpolant::natural)
    weights = naturalWeights(corners, positions, space, settings);
#ifdef PROBELAB_WITH_CGAL
  else if (interpolant == Interpolant::tetrahedra)
    weights = tetrahedraWeights(corners, positions, space, settings);
#endif
  else
    weights = nearestWeights(corners, positions, space, settings);
  ProbeLayout layout = scatteredLayout(interpolant, std::move(positions), input.scene.bounds,
                                       corners, std::move(weights));
  layout.pinned = std::move(pinned);
  return layout;
}

}  // namespace probelab
