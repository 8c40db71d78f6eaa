// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/corner_weights.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "placement/barycentric.h"
#include "placement/nearest_probes.h"
#include "visible_probes.h"

namespace probelab {
namespace {

constexpr double kMaxCorners = 2e6;
}  // namespace

Lattice influenceCorners(const Box3f& box, double spacing_m, double cells_per_spacing) {
  const Vec3d edge(box.extent());
  double cell = spacing_m / cells_per_spacing;
  Vec3i count;
  for (;; cell *= 1.05) {
    double total = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double cells = std::clamp(std::round(edge[axis] / cell), 1.0, kMaxCorners);
      count[axis] = static_cast<int>(cells) + 1;
      total *= count[axis];
    }
    if (total <= kMaxCorners) return makeLattice(box, count);
  }
}

CornerWeights knnWeights(const Lattice& corners, const std::vector<Vec3f>& positions,
                         const FreeSpace& space, const CornerSettings& settings) {
  const NearestProbes probes(positions);
  const auto k = static_cast<std::size_t>(settings.k);
  CornerWeights weights(static_cast<std::size_t>(corners.pointCount()));
  parallelFor(weights.size(), 64, [&](std::size_t begin, std::size_t end) {
    std::vector<NearProbe> visible;
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f corner = corners.position(static_cast<int>(i));
      if (!space.usable(corner)) continue;
      visibleProbes(probes, positions, space, corner, k + 1, settings.visibility, visible);
      weights[i] = kernelWeights(visible, k);
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
  parallelFor(weights.size(), 64, [&](std::size_t begin, std::size_t end) {
    std::vector<NearProbe> visible;
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f corner = corners.position(static_cast<int>(i));
      if (!space.usable(corner)) {
        weights[i].clear();
        continue;
      }
      std::erase_if(weights[i], [&](const CornerWeight& w) {
        return !seesPlace(space.input().embree, positions[w.probe], corner);
      });
      if (!weights[i].empty()) continue;
      visibleProbes(probes, positions, space, corner, static_cast<std::size_t>(settings.k) + 1,
                    true, visible);
      weights[i] = kernelWeights(visible, static_cast<std::size_t>(settings.k));
    }
  });
  return weights;
}
#endif

}  // namespace probelab
