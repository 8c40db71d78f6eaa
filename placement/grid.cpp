// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"

namespace probelab {
namespace {

constexpr float kInset = 0.05f;  // of the spacing, between the outermost probes and the walls

// Sum of squared distances of the logarithms of the cell's edges from their mean.
double cellSpread(const Vec3f& edges, const Vec3i& count) {
  double logs[3], mean = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    logs[axis] = std::log(static_cast<double>(edges[axis]) / std::max(count[axis] - 1, 1));
    mean += logs[axis] / 3;
  }
  double spread = 0;
  for (const double value : logs) spread += (value - mean) * (value - mean);
  return spread;
}

// The box whose lattice keeps the inset to the given one: spacing s = edge / (n - 1 + 2 inset).
Box3f insetBox(const Box3f& box, const Vec3i& count) {
  Box3f inset = box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (count[axis] == 1) continue;
    const float spacing =
        (box.max[axis] - box.min[axis]) / (static_cast<float>(count[axis] - 1) + 2 * kInset);
    inset.min[axis] += kInset * spacing;
    inset.max[axis] -= kInset * spacing;
  }
  return inset;
}

ProbeLayout placeGrid(const PlacementInput& input) {
  const bool free_space = input.box == LatticeBox::free_space;
  const Box3f box = free_space ? input.reachability.reachable_box : input.scene.bounds;
  const Vec3i count = cubicCounts(box.extent(), input.probes, input.vertical);
  const Lattice lattice = makeLattice(free_space ? insetBox(box, count) : box, count);
  return latticeLayout(lattice, input.scene.bounds, reachablePoints(lattice, input));
}

}  // namespace

const Strategy kGridStrategy = {
    "grid", "a regular lattice with near to cubic cells in the reachable free space", placeGrid};

Vec3i cubicCounts(const Vec3f& box_edges, int probes, double vertical) {
  Vec3f edges = box_edges;
  edges.y /= static_cast<float>(vertical);
  const int fewest = static_cast<int>(std::ceil(0.9 * probes));
  Vec3i best(1, 1, 1);
  double best_spread = std::numeric_limits<double>::infinity();
  for (int x = 1; x <= probes; ++x)
    for (int y = 1; y <= probes / x; ++y)
      for (int z = std::max(1, (fewest + x * y - 1) / (x * y)); z <= probes / (x * y); ++z) {
        const double spread = cellSpread(edges, {x, y, z});
        const bool tie = std::abs(spread - best_spread) < 1e-9;
        const bool larger = x * y * z > best.x * best.y * best.z;
        if (tie ? larger : spread < best_spread) best = {x, y, z}, best_spread = spread;
      }
  return best;
}

std::vector<uint8_t> reachablePoints(const Lattice& lattice, const PlacementInput& input) {
  std::vector<uint8_t> keep(static_cast<std::size_t>(lattice.pointCount()));
  parallelFor(keep.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      keep[i] = isReachable(input.reachability, input.embree, lattice.position(static_cast<int>(i)))
                    ? 1
                    : 0;
  });
  return keep;
}

}  // namespace probelab
