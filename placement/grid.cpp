// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/parallel.h"

namespace probelab {
namespace {

constexpr double kInset = 0.05;  // of the spacing, between the outermost probes and the walls

// Sum of squared distances of the logarithms of the cell's edges from their mean.
double spreadOf(const std::array<double, 3>& logs) {
  const double mean = (logs[0] + logs[1] + logs[2]) / 3;
  double spread = 0;
  for (const double value : logs) spread += (value - mean) * (value - mean);
  return spread;
}

ProbeLayout placeGrid(const PlacementInput& input) {
  const bool free_space = choiceOption(input, "box", {"free", "bounds"}) == 0;
  const double vertical = numberOption(input, "vertical", 0.25, 8);
  const Box3f box = free_space ? freeSpaceBox(input) : input.scene.bounds;
  const Vec3i count = cubicCounts(box.extent(), input.probes, vertical);
  const Lattice lattice = makeLattice(free_space ? insetBox(box, count, kInset) : box, count);
  return latticeLayout(lattice, input.scene.bounds, reachablePoints(lattice, input));
}

}  // namespace

const Strategy kGridStrategy = {
    "grid",
    "a regular lattice with near to cubic cells in the reachable free space",
    {{"box", "free", "free | bounds",
      "what the lattice fills: the reachable free space, or the bounds with the walls in them"},
     {"vertical", "1", "0.25 .. 8", "vertical spacing over the horizontal one"}},
    placeGrid};

Vec3i cubicCounts(const Vec3f& box_edges, int probes, double vertical) {
  std::array<double, 3> edges;
  for (std::size_t axis = 0; axis < 3; ++axis)
    edges[axis] = std::log(static_cast<double>(box_edges[axis]) / (axis == 1 ? vertical : 1));
  std::vector<double> gaps(static_cast<std::size_t>(probes) + 1);  // [count]: log of cells
  for (std::size_t n = 1; n < gaps.size(); ++n)
    gaps[n] = std::log(static_cast<double>(std::max<std::size_t>(n - 1, 1)));
  const int fewest = static_cast<int>(std::ceil(0.9 * probes));
  Vec3i best(1, 1, 1);
  double best_spread = std::numeric_limits<double>::infinity();
  for (int x = 1; x <= probes; ++x)
    for (int y = 1; y <= probes / x; ++y)
      for (int z = std::max(1, (fewest + x * y - 1) / (x * y)); z <= probes / (x * y); ++z) {
        const double spread = spreadOf({edges[0] - gaps[static_cast<std::size_t>(x)],
                                        edges[1] - gaps[static_cast<std::size_t>(y)],
                                        edges[2] - gaps[static_cast<std::size_t>(z)]});
        const bool tie = std::abs(spread - best_spread) < 1e-9;
        const bool larger = x * y * z > best.x * best.y * best.z;
        if (tie ? larger : spread < best_spread) best = {x, y, z}, best_spread = spread;
      }
  return best;
}

Box3f insetBox(const Box3f& box, const Vec3i& count, double inset) {
  Box3f result = box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (count[axis] == 1) continue;
    const float share = static_cast<float>(inset / (count[axis] - 1 + 2 * inset));
    const float margin = share * (box.max[axis] - box.min[axis]);
    result.min[axis] += margin;
    result.max[axis] -= margin;
  }
  return result;
}

Box3f freeSpaceBox(const PlacementInput& input) {
  Box3f box = input.reachability.reachable_box;
  if (box.empty()) return input.scene.bounds;
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (!(box.max[axis] > box.min[axis])) {
      box.min[axis] = input.scene.bounds.min[axis];
      box.max[axis] = input.scene.bounds.max[axis];
    }
  return box;
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
