// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/corner_weights.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/interrupt.h"
#include "base/parallel.h"
#include "placement/barycentric.h"
#include "placement/grid.h"
#include "placement/nearest_probes.h"
#include "visible_probes.h"

namespace probelab {
namespace {

constexpr double kMaxCorners = 2e6;
// Of the spacing, from the free space's box to the outer corners: about where queries of walls come
// from. Corners on the walls, or half-way to the next ones, cost 1 % of nrmse.
constexpr float kFromWalls = 0.075f;

// Means of the normalised sets.
std::vector<CornerWeight> meanWeights(const std::vector<std::vector<CornerWeight>>& sets) {
  std::map<uint32_t, float> mean;
  for (const auto& set : sets) {
    float sum = 0;
    for (const CornerWeight& w : set) sum += w.weight;
    if (!(sum > 0)) continue;
    for (const CornerWeight& w : set)
      mean[w.probe] += w.weight / (sum * static_cast<float>(sets.size()));
  }
  std::vector<CornerWeight> weights;
  for (const auto& [probe, weight] : mean) weights.push_back({probe, weight});
  return weights;
}

// Calls fill(corner, its viewpoints) for every corner that has any.
template <class Fill>
void forCorners(const Lattice& corners, const FreeSpace& space, const Fill& fill) {
  parallelFor(static_cast<std::size_t>(corners.pointCount()), 64,
              [&](std::size_t begin, std::size_t end) {
                throwIfInterrupted();
                for (std::size_t i = begin; i < end; ++i) {
                  const std::vector<Vec3f> from = viewpoints(corners, i, space);
                  if (!from.empty()) fill(i, from);
                }
              });
}

}  // namespace

Box3f influenceBox(const PlacementInput& input, double spacing_m) {
  const Box3f free = outerBox(input, {});
  const Vec3f inset = componentMin(Vec3f(kFromWalls * static_cast<float>(spacing_m)),
                                   free.extent() * 0.25f);
  return {free.min + inset, free.max - inset};
}

Lattice influenceCorners(const Box3f& box, double spacing_m, double cells_per_spacing) {
  const Vec3d edge(box.extent());
  double cell = spacing_m / cells_per_spacing;
  Vec3i count;
  for (;; cell *= 1.05) {
    double total = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double cells = std::clamp(std::round(edge[axis] / cell), 2.0, kMaxCorners);
      count[axis] = static_cast<int>(cells) + 1;
      total *= count[axis];
    }
    if (total <= kMaxCorners) return makeLattice(box, count);
  }
}

std::vector<Vec3f> viewpoints(const Lattice& corners, std::size_t corner, const FreeSpace& space) {
  const Vec3f p = corners.position(static_cast<int>(corner));
  if (space.usable(p)) return {p};
  std::vector<Vec3f> places;
  for (int k = 0; k < 8; ++k) {
    const Vec3f octant(k & 1 ? 0.25f : -0.25f, k & 2 ? 0.25f : -0.25f, k & 4 ? 0.25f : -0.25f);
    const Vec3f place = p + octant * corners.spacing;
    if (space.usable(place)) places.push_back(place);
  }
  return places;
}

std::vector<CornerWeight> nearestFrom(const NearestProbes& probes, const std::vector<Vec3f>& positions,
                                  const FreeSpace& space, const std::vector<Vec3f>& from,
                                  const CornerSettings& settings) {
  const auto k = static_cast<std::size_t>(settings.k);
  std::vector<NearProbe> visible;
  std::vector<std::vector<CornerWeight>> sets;
  for (const Vec3f& place : from) {
    visibleProbes(probes, positions, space, place, k + 1, settings.visibility, visible);
    sets.push_back(settings.sharpness > 0
                       ? maxentWeights(visible, k, positions, place, settings.sharpness,
                                       settings.cutoff)
                       : kernelWeights(visible, k));
  }
  return sets.size() == 1 ? sets[0] : meanWeights(sets);
}

CornerWeights nearestWeights(const Lattice& corners, const std::vector<Vec3f>& positions,
                         const FreeSpace& space, const CornerSettings& settings) {
  const NearestProbes probes(positions);
  CornerWeights weights(static_cast<std::size_t>(corners.pointCount()));
  forCorners(corners, space, [&](std::size_t i, const std::vector<Vec3f>& from) {
    weights[i] = nearestFrom(probes, positions, space, from, settings);
  });
  if (std::ranges::all_of(weights, [](const auto& at) { return at.empty(); }))
    for (auto& at : weights) at = nearestFrom(probes, positions, space, {space.roomiest()}, settings);
  return weights;
}

CornerWeights pieceWeights(const WallPieces& pieces, const Lattice& corners, CornerWeights weights,
                           const std::vector<Vec3f>& positions, const FreeSpace& space,
                           const CornerSettings& settings) {
  const NearestProbes probes(positions);
  weights.resize(pieces.viewpoints.size());
  parallelFor(weights.size(), 64, [&](std::size_t begin, std::size_t end) {
    throwIfInterrupted();
    for (std::size_t i = begin; i < end; ++i) {
      const std::vector<Vec3f>& from = pieces.viewpoints[i];
      if (from.empty()) continue;
      const auto corner = static_cast<int>(pieces.corner[i]);
      if (from.size() == 1 && from[0] == corners.position(corner)) continue;
      weights[i] = nearestFrom(probes, positions, space, from, settings);
    }
  });
  return weights;
}

#ifdef PROBELAB_WITH_CGAL
CornerWeights tetrahedraWeights(const Lattice& corners, const std::vector<Vec3f>& positions,
                                const FreeSpace& space, const CornerSettings& settings) {
  CornerWeights weights = barycentricWeights(corners, positions);
  if (!settings.visibility) return weights;
  const NearestProbes probes(positions);
  const EmbreeScene& embree = space.input().embree;
  CornerWeights seen(weights.size());
  forCorners(corners, space, [&](std::size_t i, const std::vector<Vec3f>& from) {
    seen[i] = std::move(weights[i]);
    std::erase_if(seen[i], [&](const CornerWeight& w) {
      return std::ranges::none_of(
          from, [&](const Vec3f& p) { return seesPlace(embree, positions[w.probe], p); });
    });
    if (seen[i].empty()) seen[i] = nearestFrom(probes, positions, space, from, settings);
  });
  if (std::ranges::all_of(seen, [](const auto& at) { return at.empty(); }))
    return barycentricWeights(corners, positions);
  return seen;
}
#endif

}  // namespace probelab
