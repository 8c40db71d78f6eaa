// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/interrupt.h"
#include "base/parallel.h"
#include "placement/free_space.h"

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
  return usableLayout(gridLattice(input), input);
}

// A lattice of one point that lies at p.
Lattice singlePoint(const PlacementInput& input, const Vec3f& p) {
  const Vec3f half = input.scene.bounds.extent() * 0.5f;
  Lattice lattice = makeLattice({p - half, p + half}, {1, 1, 1});
  lattice.first = p;
  return lattice;
}

}  // namespace

const Strategy kGridStrategy = {
    "grid",
    "a regular lattice with near to cubic cells in the reachable free space",
    {{"box", "free", "free | bounds",
      "what the lattice fills: the reachable free space, or the bounds with the walls in them"},
     {"vertical", "1", "0.25 .. 8", "vertical spacing over the horizontal one"},
     {"offset", "0", "-1 .. 1",
      "moves the lattice along every axis with more than one probe, in spacings"}},
    placeGrid};

namespace {

constexpr double kTie = 1e-9;  // of spreads

struct RankedCounts {
  double spread;
  Vec3i count;
};

// Calls visit(spread, count) for every count with 0.9 N <= n <= N points.
template <class Visit>
void forCounts(const Vec3f& box_edges, int probes, double vertical, const Visit& visit) {
  std::array<double, 3> edges;
  for (std::size_t axis = 0; axis < 3; ++axis)
    edges[axis] = std::log(static_cast<double>(box_edges[axis]) / (axis == 1 ? vertical : 1));
  std::vector<double> gaps(static_cast<std::size_t>(probes) + 1);  // [count]: log of cells
  for (std::size_t n = 1; n < gaps.size(); ++n)
    gaps[n] = std::log(static_cast<double>(std::max<std::size_t>(n - 1, 1)));
  const int fewest = static_cast<int>(std::ceil(0.9 * probes));
  for (int x = 1; x <= probes; ++x)
    for (int y = 1; y <= probes / x; ++y)
      for (int z = std::max(1, (fewest + x * y - 1) / (x * y)); z <= probes / (x * y); ++z)
        visit(spreadOf({edges[0] - gaps[static_cast<std::size_t>(x)],
                        edges[1] - gaps[static_cast<std::size_t>(y)],
                        edges[2] - gaps[static_cast<std::size_t>(z)]}),
              Vec3i(x, y, z));
}

int pointsOf(const Vec3i& count) { return count.x * count.y * count.z; }

// Longest edge of what a point of the box answers for. Cells between points say nothing of it on an
// axis of one or two points.
float longestShare(const Vec3f& edges, const Vec3i& count) {
  float longest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis)
    longest = std::max(longest, edges[axis] / static_cast<float>(count[axis]));
  return longest;
}

}  // namespace

Lattice gridLattice(const PlacementInput& input) {
  const bool free_space = choiceOption(input, "box", {"free", "bounds"}) == 0;
  const double vertical = numberOption(input, "vertical", 0.25, 8);
  const double offset = numberOption(input, "offset", -1, 1);
  const LatticeBox box{free_space, free_space ? kInset : 0};
  const Vec3i count = cubicCounts(outerBox(input, box).extent(), input.probes, vertical);
  Lattice lattice = latticeIn(input, box, count);
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (count[axis] > 1) lattice.first[axis] += lattice.spacing[axis] * static_cast<float>(offset);
  return lattice;
}

Vec3i cubicCounts(const Vec3f& edges, int probes, double vertical) {
  Vec3i best(1, 1, 1);
  double best_spread = std::numeric_limits<double>::infinity();
  const auto better = [&](double spread, const Vec3i& count) {
    if (std::abs(spread - best_spread) >= kTie) return spread < best_spread;
    if (pointsOf(count) != pointsOf(best)) return pointsOf(count) > pointsOf(best);
    return longestShare(edges, count) < longestShare(edges, best);
  };
  forCounts(edges, probes, vertical, [&](double spread, const Vec3i& count) {
    if (better(spread, count)) best = count, best_spread = spread;
  });
  return best;
}

std::vector<Vec3i> likelyCounts(const Vec3f& edges, int probes, std::size_t most) {
  std::vector<RankedCounts> ranked;
  const auto better = [&](const RankedCounts& a, const RankedCounts& b) {
    if (a.spread != b.spread) return a.spread < b.spread;
    if (pointsOf(a.count) != pointsOf(b.count)) return pointsOf(a.count) > pointsOf(b.count);
    return longestShare(edges, a.count) < longestShare(edges, b.count);
  };
  forCounts(edges, probes, 1, [&](double spread, const Vec3i& count) {
    ranked.push_back({spread, count});
    std::push_heap(ranked.begin(), ranked.end(), better);
    if (ranked.size() <= most) return;
    std::pop_heap(ranked.begin(), ranked.end(), better);
    ranked.pop_back();
  });
  std::sort_heap(ranked.begin(), ranked.end(), better);
  std::vector<Vec3i> counts;
  for (const RankedCounts& r : ranked) counts.push_back(r.count);
  return counts;
}

Box3f outerBox(const PlacementInput& input, const LatticeBox& box) {
  const Box3f& bounds = input.scene.bounds;
  Box3f outer = box.free_space ? input.reachability.reachable_box : bounds;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(outer.max[axis] > outer.min[axis])) {
      outer.min[axis] = bounds.min[axis];
      outer.max[axis] = bounds.max[axis];
    }
    const auto margin = static_cast<float>(box.margin_m);
    if (outer.max[axis] - outer.min[axis] <= 2.5f * margin) continue;
    outer.min[axis] += margin;
    outer.max[axis] -= margin;
  }
  return outer;
}

Lattice latticeIn(const PlacementInput& input, const LatticeBox& box, const Vec3i& count) {
  Box3f inner = outerBox(input, box);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (count[axis] == 1) continue;
    const auto share = static_cast<float>(box.inset / (count[axis] - 1 + 2 * box.inset));
    const float margin = share * (inner.max[axis] - inner.min[axis]);
    inner.min[axis] += margin;
    inner.max[axis] -= margin;
  }
  return makeLattice(inner, count);
}

std::vector<LatticeBox> likelyBoxes(const PlacementInput& input) {
  constexpr double kMargin = 0.12;
  std::vector<LatticeBox> boxes = {{true, 0.05}, {true, 0.15}, {true, 0.3},
                                   {true, 0.5},  {false, 0.5}, {false, 0}};
  if (minComponent(outerBox(input, {true}).extent()) > 4 * kMargin)
    boxes.push_back({true, 0, kMargin});
  return boxes;
}

std::vector<uint8_t> usablePoints(const Lattice& lattice, const PlacementInput& input) {
  std::vector<uint8_t> keep(static_cast<std::size_t>(lattice.pointCount()));
  parallelFor(keep.size(), 64, [&](std::size_t begin, std::size_t end) {
    throwIfInterrupted();
    for (std::size_t i = begin; i < end; ++i)
      keep[i] = isUsable(input, lattice.position(static_cast<int>(i))) ? 1 : 0;
  });
  return keep;
}

ProbeLayout usableLayout(const Lattice& lattice, const PlacementInput& input) {
  const std::vector<uint8_t> keep = usablePoints(lattice, input);
  if (std::ranges::any_of(keep, [](uint8_t k) { return k != 0; }))
    return latticeLayout(lattice, input.scene.bounds, keep);
  return latticeLayout(singlePoint(input, FreeSpace(input).roomiest()), input.scene.bounds, {1});
}

}  // namespace probelab
