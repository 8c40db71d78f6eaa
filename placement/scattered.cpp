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

bool sameLattice(const Lattice& a, const Lattice& b) {
  return a.first == b.first && a.spacing == b.spacing && a.count == b.count;
}

std::string interpolantNames() { return fmt::format("{}", fmt::join(names(), " | ")); }

// The options of `scatteredOptions`.
struct ScatteredChoice {
  Interpolant interpolant{};
  CornerSettings settings;
  double cells = 0;
  bool walls = false;
};

ScatteredChoice readScattered(const PlacementInput& input) {
  ScatteredChoice choice;
  choice.interpolant =
      kInterpolants[static_cast<std::size_t>(choiceOption(input, "interpolant", names()))];
  const bool maxent = choice.interpolant == Interpolant::maxent;
  CornerSettings& settings = choice.settings;
  settings.k = integerOption(input, "k", 0, 64);
  if (settings.k == 0) settings.k = maxent ? 16 : 8;
  const double sharpness = numberOption(input, "sharpness", 0.01, 100);
  if (maxent) settings.sharpness = sharpness;
  settings.cutoff = numberOption(input, "cutoff", 0, 0.3);
  settings.visibility = choiceOption(input, "visibility", {"on", "off"}) == 0;
  choice.cells = numberOption(input, "cells", 0.5, 8);
  choice.walls = choiceOption(input, "walls", {"on", "off"}) == 0 && settings.visibility;
  return choice;
}

}  // namespace

void checkScatteredOptions(const PlacementInput& input) { readScattered(input); }

std::vector<StrategyOption> scatteredOptions(std::vector<StrategyOption> own) {
  own.push_back({"interpolant", "maxent", interpolantNames(),
                 "what weighs the probes: maximum entropy, k nearest, natural neighbours, Delaunay "
                 "tetrahedra"});
  own.push_back(
      {"k", "0", "0 .. 64", "probes that count at a place; 0: 16 with maxent, 8 with knn"});
  own.push_back({"sharpness", "10", "0.01 .. 100",
                 "with maxent: of the kernel; low ones smooth, high ones tend to tetrahedra"});
  own.push_back({"cutoff", "0.05", "0 .. 0.3",
                 "with maxent: smaller shares are left out, and the others weighed anew"});
  own.push_back({"visibility", "on", "on | off", "only probes that a place sees count there"});
  own.push_back({"walls", "on", "on | off",
                 "voxels that a wall divides have weights of their own on either side, by what a "
                 "place sees: none with visibility=off"});
  own.push_back({"cells", "3", "0.5 .. 8", "voxels of the query's index along one mean spacing"});
  return own;
}

ScatteredWeights scatteredWeights(const FreeSpace& space, const std::vector<Vec3f>& positions,
                                  KnownWalls* known) {
  const PlacementInput& input = space.input();
  const auto [interpolant, settings, cells, walls] = readScattered(input);
  ScatteredWeights result;
  result.interpolant = interpolant;
  const double spacing_m = space.spacing(static_cast<int>(positions.size()));
  const Lattice& corners = result.corners =
      influenceCorners(influenceBox(input, spacing_m), spacing_m, cells);
  CornerWeights& weights = result.weights;
  if (interpolant == Interpolant::natural)
    weights = naturalWeights(corners, positions, space, settings);
#ifdef PROBELAB_WITH_CGAL
  else if (interpolant == Interpolant::tetrahedra)
    weights = tetrahedraWeights(corners, positions, space, settings);
#endif
  else
    weights = nearestWeights(corners, positions, space, settings);
  if (!walls) return result;
  KnownWalls own;
  KnownWalls& found = known != nullptr ? *known : own;
  if (found.walls.viewpoints.empty() || !sameLattice(found.corners, corners))
    found = {corners, findWallPieces(corners, space)};
  weights = pieceWeights(found.walls, corners, std::move(weights), positions, space, settings);
  result.pieces = found.walls.pieces;
  return result;
}

ProbeLayout scatterProbes(const FreeSpace& space, std::vector<Vec3f> positions,
                          std::vector<uint8_t> pinned, KnownWalls* known) {
  ScatteredWeights w = scatteredWeights(space, positions, known);
  ProbeLayout layout =
      scatteredLayout(w.interpolant, std::move(positions), space.input().scene.bounds, w.corners,
                      std::move(w.weights), w.pieces);
  layout.pinned = std::move(pinned);
  return layout;
}

}  // namespace probelab
