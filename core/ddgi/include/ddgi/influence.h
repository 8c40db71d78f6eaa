// SPDX-License-Identifier: Apache-2.0
// How probes that lie on no lattice weigh in a query: at each corner of a grid of voxels a few
// probes have a weight, and between the corners weights are trilinear. So a weight is continuous
// everywhere whatever gave the corners theirs: k-nearest kernels, barycentric coordinates, a fit.
// A lattice's own points as corners, each with its probe alone, give the lattice's trilinear query
// exactly.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.h"

namespace probelab {

// A box of count.x * count.y * count.z points from face to face; one point on an axis lies in the
// middle and `spacing` is then the box's edge. x runs fastest.
struct Lattice {
  Vec3f first, spacing;
  Vec3i count{1, 1, 1};
  int pointCount() const { return count.x * count.y * count.z; }
  Vec3f position(int index) const;
};

// The lattice of `count` points in a box; edges must be positive.
Lattice makeLattice(const Box3f& box, const Vec3i& count);

// A probe's weight at one corner; not negative.
struct CornerWeight {
  uint32_t probe = 0;
  float weight = 0;
};
// [corner of the grid]: the probes that count there; empty where no query can come from.
using CornerWeights = std::vector<std::vector<CornerWeight>>;

// A probe in one voxel: its weight at the voxel's corners in units of 1/255, corner x + 2 y + 4 z.
struct InfluenceEntry {
  uint32_t probe = 0;
  std::array<uint8_t, 8> weights{};
};
static_assert(sizeof(InfluenceEntry) == 12);

struct InfluenceGrid {
  Lattice corners;                      // at least 2 an axis
  std::vector<uint32_t> voxel_begin;    // [voxel + 1], x fastest: first entry
  std::vector<InfluenceEntry> entries;  // by probe within a voxel
  std::vector<int32_t> nearest;         // [voxel]: the probe that answers where no weight does
  Vec3i voxels() const { return corners.count - Vec3i(1, 1, 1); }
};

// Corner weights, scaled so that each corner's sum is 1 (the query divides by the sum of weights
// anyway) and rounded; every corner keeps at least its largest. A corner without probes takes the
// mean of its neighbours', again and again, so that no voxel is empty. `nearest` is the probe
// nearest to the voxel's middle among its entries. Throws InputError when no corner has a probe.
InfluenceGrid makeInfluence(const Lattice& corners, CornerWeights weights,
                            const std::vector<Vec3f>& positions);

// The same without the probes that are not active; `nearest` becomes an active one wherever there
// is any.
InfluenceGrid activeInfluence(const InfluenceGrid& grid, const std::vector<Vec3f>& positions,
                              const std::vector<uint8_t>& active);

// Throws InputError naming `what` when indices or sizes do not fit.
void validateInfluence(const InfluenceGrid& grid, std::size_t probes, const std::string& what);

uint64_t influenceBytes(const InfluenceGrid& grid);  // as the device holds it

}  // namespace probelab
