// SPDX-License-Identifier: Apache-2.0
// How probes that lie on no lattice weigh in a query: at each corner of a grid of voxels a few
// probes have a weight, and between the corners weights are trilinear. So a weight is continuous
// everywhere whatever gave the corners theirs: k-nearest kernels, barycentric coordinates, a fit.
// A lattice's own points as corners, each with its probe alone, give the lattice's trilinear query
// exactly.
//
// Walls: a voxel that a wall divides has two *pieces*, one on each side of a plane within the wall,
// and a corner may mean something else to each piece around it. So what lies behind a wall has no
// weight at all, however thin the wall is, and weights jump within walls alone.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.h"
#include "shared/query_params.h"

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

// A probe in one voxel: a byte for its weight at each of the voxel's corners x + 2 y + 4 z, 0 where
// it has none. Weights are squares, (byte / PL_WEIGHT_ONE)^2: small ones keep their digits, 1 is
// exact, and a corner may weigh some four times as much as its neighbours.
struct InfluenceEntry {
  uint32_t probe = 0;
  std::array<uint8_t, 8> weights{};
};
static_assert(sizeof(InfluenceEntry) == 12);
inline float byteWeight(uint8_t byte) {
  const float root = static_cast<float>(byte) / static_cast<float>(PL_WEIGHT_ONE);
  return root * root;
}
uint8_t weightByte(float weight);  // of a positive weight: 1 to 255

// How voxels fall into pieces. Piece v is voxel v (x fastest), or its front where plane_of_voxel[v]
// = k is not negative; piece voxels + k is then its back, where dot(normal, p) + offset < 0 with p
// relative to the first corner of the grid.
struct VoxelPieces {
  std::vector<int32_t> plane_of_voxel;  // [voxel], -1: whole; empty: no wall anywhere
  std::vector<Vec4f> planes;            // [plane]: unit normal, offset in metres
  // [piece]: the lists of CornerWeights that count at its corners; empty: those of the grid.
  std::vector<std::array<uint32_t, 8>> lists;
  bool any() const { return !plane_of_voxel.empty(); }
};

struct InfluenceGrid {
  Lattice corners;                      // at least 2 an axis
  VoxelPieces pieces;                   // its lists are left out
  std::vector<uint32_t> voxel_begin;    // [piece + 1]: first entry
  std::vector<InfluenceEntry> entries;  // by probe within a piece
  std::vector<int32_t> nearest;         // [piece]: the probe that answers where no weight does
  Vec3i voxels() const { return corners.count - Vec3i(1, 1, 1); }
};

// The voxel around a point (of points outside the nearest one), its piece there, and the trilinear
// shares of its corners.
struct VoxelPlace {
  std::size_t voxel = 0, piece = 0;
  std::array<float, 8> share{};
};
VoxelPlace voxelAt(const Lattice& corners, const VoxelPieces& pieces, const Vec3f& p);
// Corner k of a voxel (x + 2 y + 4 z) in the grid of corners.
std::size_t voxelCorner(const Lattice& corners, std::size_t voxel, int k);

// The query divides by the sum of weights, but between corners the larger sum counts more: `one`
// scales each corner's sum to 1, `kept` leaves what a fit gave them (weights above 3.9 take their
// corner down with them).
enum class CornerScale { one, kept };

// The index of corner weights, rounded; what is below 1/4096 of a corner's sum is left out, but the
// largest stays. A corner without probes takes the mean of its neighbours', again and again, so that
// no voxel is empty. `nearest` is the probe nearest to the voxel's middle among its entries. Throws
// InputError when no corner has a probe. With `pieces` lists beyond those of the corners must not be
// empty.
InfluenceGrid makeInfluence(const Lattice& corners, CornerWeights weights,
                            const std::vector<Vec3f>& positions, VoxelPieces pieces = {},
                            CornerScale scale = CornerScale::one);

// The same without the probes that are not active; `nearest` becomes an active one wherever there
// is any.
InfluenceGrid activeInfluence(const InfluenceGrid& grid, const std::vector<Vec3f>& positions,
                              const std::vector<uint8_t>& active);

// Throws InputError naming `what` when indices or sizes do not fit.
void validateInfluence(const InfluenceGrid& grid, std::size_t probes, const std::string& what);

uint64_t influenceBytes(const InfluenceGrid& grid);  // as the device holds it

}  // namespace probelab
