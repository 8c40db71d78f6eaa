// SPDX-License-Identifier: Apache-2.0
// Where the probes are. Positions are local (relative to Scene::origin), like every position.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.h"
#include "ddgi/params.h"

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

struct ProbeLayout {
  std::string strategy;
  Box3f bounds;  // where the field answers: 1 inside, falling to 0 over one bias length outside
  Lattice lattice;
  std::vector<int> probe_of_point;  // [lattice point]: index of the stored probe, -1: none
  std::vector<Vec3f> positions;     // [stored probe]
  float bias_length_m = 0;          // s_i: the smallest spacing of an axis with more than one point
  float support_radius_m = 0;       // r_i: the cell's diagonal
  double build_s = 0;
};

// A layout that stores the lattice points with keep[i] != 0.
ProbeLayout latticeLayout(const Lattice& lattice, const Box3f& bounds,
                          const std::vector<uint8_t>& keep);

// Throws InputError when a layout cannot be used: no stored probe, a zero or non-finite length,
// indices that do not fit, more texels than 2^31.
void validateLayout(const ProbeLayout& layout, const Params& params);

LatticeShape latticeShape(const ProbeLayout& layout, const Params& params);

// Bytes of the index from lattice points to stored probes.
uint64_t indexBytes(const ProbeLayout& layout);

}  // namespace probelab
