// SPDX-License-Identifier: Apache-2.0
#include "ddgi/influence.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"

namespace probelab {
namespace {

// A corner's weights below this share of their sum are left out; the largest stays.
constexpr double kLeastShare = 1.0 / 4096;
constexpr float kMostWeight = 3.9f;  // that a byte can hold, and a little less

std::size_t asSize(int value) { return static_cast<std::size_t>(value); }

int gridIndex(const Vec3i& count, int x, int y, int z) { return (z * count.y + y) * count.x + x; }

Vec3i gridPlace(const Vec3i& count, int index) {
  return {index % count.x, index / count.x % count.y, index / (count.x * count.y)};
}

// Sorted by probe, one entry a probe, zero weights left out.
void mergeProbes(std::vector<CornerWeight>& weights, std::size_t probes) {
  for (const CornerWeight& w : weights) {
    PROBELAB_CHECK(w.probe < probes);
    PROBELAB_CHECK(std::isfinite(w.weight) && w.weight >= 0);
  }
  std::sort(weights.begin(), weights.end(),
            [](const CornerWeight& a, const CornerWeight& b) { return a.probe < b.probe; });
  std::size_t kept = 0;
  for (const CornerWeight& w : weights) {
    if (w.weight == 0) continue;
    if (kept > 0 && weights[kept - 1].probe == w.probe)
      weights[kept - 1].weight += w.weight;
    else
      weights[kept++] = w;
  }
  weights.resize(kept);
}

// Leaves out what is too small; the largest stays. Returns the sum before.
double dropSmall(std::vector<CornerWeight>& weights) {
  double sum = 0;
  float largest = 0;
  for (const CornerWeight& w : weights) {
    sum += static_cast<double>(w.weight);
    largest = std::max(largest, w.weight);
  }
  std::erase_if(weights, [&](const CornerWeight& w) {
    return w.weight < largest && static_cast<double>(w.weight) < kLeastShare * sum;
  });
  return sum;
}

// By their sum, or as they are where a byte can hold them. Some must be above 0.
void scaleCorner(std::vector<CornerWeight>& weights, double sum, CornerScale scale) {
  float largest = 0;
  for (const CornerWeight& w : weights) largest = std::max(largest, w.weight);
  const double factor = scale == CornerScale::one
                            ? 1 / sum
                            : std::min(1.0, static_cast<double>(kMostWeight / largest));
  for (CornerWeight& w : weights)
    w.weight = static_cast<float>(factor * static_cast<double>(w.weight));
}

// The mean of the corners beside one, of those that have probes.
std::vector<CornerWeight> neighboursMean(const CornerWeights& corners, const Vec3i& count,
                                         int index) {
  const Vec3i at = gridPlace(count, index);
  std::vector<CornerWeight> mean;
  int found = 0;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const int step : {-1, 1}) {
      Vec3i beside = at;
      beside[axis] += step;
      if (beside[axis] < 0 || beside[axis] >= count[axis]) continue;
      const auto& list = corners[asSize(gridIndex(count, beside.x, beside.y, beside.z))];
      mean.insert(mean.end(), list.begin(), list.end());
      if (!list.empty()) ++found;
    }
  for (CornerWeight& w : mean) w.weight /= static_cast<float>(found);
  mergeProbes(mean, std::numeric_limits<uint32_t>::max());
  dropSmall(mean);
  return mean;
}

// Gives every empty corner of the grid the mean of its neighbours', ring by ring.
void fillEmptyCorners(CornerWeights& corners, const Vec3i& count) {
  std::vector<int> empty;
  for (int i = 0; i < count.x * count.y * count.z; ++i)
    if (corners[asSize(i)].empty()) empty.push_back(i);
  PROBELAB_CHECK(empty.size() < corners.size());
  while (!empty.empty()) {
    CornerWeights means(empty.size());
    parallelFor(empty.size(), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) means[i] = neighboursMean(corners, count, empty[i]);
    });
    std::vector<int> still_empty;
    for (std::size_t i = 0; i < empty.size(); ++i) {
      if (means[i].empty()) still_empty.push_back(empty[i]);
      corners[asSize(empty[i])] = std::move(means[i]);
    }
    empty = std::move(still_empty);
  }
}

// The union of the probes of a piece's corners, by probe.
std::vector<InfluenceEntry> pieceEntries(const InfluenceGrid& grid, const VoxelPieces& pieces,
                                         std::size_t piece, const CornerWeights& corners) {
  std::vector<InfluenceEntry> entries;
  for (int k = 0; k < 8; ++k)
    for (const CornerWeight& share :
         corners[pieces.lists.empty() ? voxelCorner(grid.corners, piece, k)
                                      : pieces.lists[piece][asSize(k)]]) {
      auto found = std::lower_bound(
          entries.begin(), entries.end(), share.probe,
          [](const InfluenceEntry& entry, uint32_t probe) { return entry.probe < probe; });
      if (found == entries.end() || found->probe != share.probe)
        found = entries.insert(found, InfluenceEntry{share.probe, {}});
      found->weights[asSize(k)] = weightByte(share.weight);
    }
  return entries;
}

std::size_t voxelCount(const InfluenceGrid& grid) {
  const Vec3i voxels = grid.voxels();
  return asSize(voxels.x) * asSize(voxels.y) * asSize(voxels.z);
}

std::size_t pieceCount(const InfluenceGrid& grid) {
  return voxelCount(grid) + grid.pieces.planes.size();
}

// [piece]: its voxel.
std::vector<std::size_t> voxelOfPiece(const InfluenceGrid& grid) {
  std::vector<std::size_t> voxels(pieceCount(grid));
  for (std::size_t v = 0; v < voxelCount(grid); ++v) {
    voxels[v] = v;
    if (grid.pieces.any() && grid.pieces.plane_of_voxel[v] >= 0)
      voxels[voxelCount(grid) + asSize(grid.pieces.plane_of_voxel[v])] = v;
  }
  return voxels;
}

Vec3f voxelMiddle(const InfluenceGrid& grid, std::size_t voxel) {
  const Vec3i at = gridPlace(grid.voxels(), static_cast<int>(voxel));
  const Vec3f middle(static_cast<float>(at.x) + 0.5f, static_cast<float>(at.y) + 0.5f,
                     static_cast<float>(at.z) + 0.5f);
  return grid.corners.first + middle * grid.corners.spacing;
}

float squaredDistance(const Vec3f& a, const Vec3f& b) { return dot(a - b, a - b); }

// Nearest of a piece's entries to a place; -1 without entries.
int32_t nearestEntry(const InfluenceGrid& grid, std::size_t piece, const Vec3f& middle,
                     const std::vector<Vec3f>& positions) {
  int32_t nearest = -1;
  float best = std::numeric_limits<float>::infinity();
  for (uint32_t e = grid.voxel_begin[piece]; e < grid.voxel_begin[piece + 1]; ++e) {
    const uint32_t probe = grid.entries[e].probe;
    const float d = squaredDistance(positions[probe], middle);
    if (d < best) best = d, nearest = static_cast<int32_t>(probe);
  }
  return nearest;
}

uint64_t hashShare(uint32_t probe, uint8_t weight) {
  uint64_t h = (static_cast<uint64_t>(probe) << 8 | weight) + 0x9e3779b97f4a7c15u;
  h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9u;
  h = (h ^ (h >> 27)) * 0x94d049bb133111ebu;
  return h ^ (h >> 31);
}

// Above 0 before a voxel's plane, below 0 behind it.
float sideOf(const Lattice& corners, const Vec4f& plane, const Vec3f& p) {
  return dot(Vec3f(plane.x, plane.y, plane.z), p - corners.first) + plane.w;
}

// What an entry of voxel_begin is called: the second sides of divided voxels come after all voxels.
const char* pieceWord(const InfluenceGrid& grid) { return grid.pieces.any() ? "piece" : "voxel"; }

// Every piece must have a probe at each corner. Without walls every voxel must say the same of a
// corner that it shares, or the weights would jump between them; compared by sums of hashes.
void checkCornersAgree(const InfluenceGrid& grid, const std::string& what) {
  std::vector<uint64_t> sums(asSize(grid.corners.pointCount()), 0);
  for (std::size_t piece = 0; piece < pieceCount(grid); ++piece)
    for (int k = 0; k < 8; ++k) {
      uint64_t sum = 0;
      for (uint32_t e = grid.voxel_begin[piece]; e < grid.voxel_begin[piece + 1]; ++e)
        if (const uint8_t w = grid.entries[e].weights[asSize(k)]; w > 0)
          sum += hashShare(grid.entries[e].probe, w);
      if (sum == 0)
        throwInput("{}: {} {}: no probe has a weight at corner {}", what, pieceWord(grid), piece,
                   k);
      if (grid.pieces.any()) continue;
      uint64_t& first = sums[voxelCorner(grid.corners, piece, k)];
      if (first == 0) first = sum;
      if (first != sum)
        throwInput("{}: voxel {}: the weights at corner {} are not those of the voxels beside it",
                   what, piece, k);
    }
}

void checkPieces(const InfluenceGrid& grid, std::size_t voxels, const std::string& what) {
  const VoxelPieces& pieces = grid.pieces;
  if (!pieces.any() && pieces.planes.empty()) return;
  if (pieces.plane_of_voxel.size() != voxels)
    throwInput("{}: {} planes of voxels for {} voxels", what, pieces.plane_of_voxel.size(), voxels);
  std::vector<uint8_t> used(pieces.planes.size(), 0);
  for (std::size_t v = 0; v < voxels; ++v) {
    const int32_t plane = pieces.plane_of_voxel[v];
    if (plane < 0) continue;
    if (asSize(plane) >= used.size())
      throwInput("{}: voxel {}: plane {} of {}", what, v, plane, used.size());
    if (used[asSize(plane)]++ != 0)
      throwInput("{}: voxel {}: plane {} divides another voxel already", what, v, plane);
  }
  for (std::size_t i = 0; i < used.size(); ++i) {
    const Vec4f& f = pieces.planes[i];
    const float norm = length(Vec3f(f.x, f.y, f.z));
    if (used[i] == 0 || !(std::abs(norm - 1) < 1e-3f) || !std::isfinite(f.w))
      throwInput("{}: plane {} must divide a voxel, with a unit normal and a finite offset", what,
                 i);
  }
  for (std::size_t v = 0; v < voxels; ++v) {
    const int32_t plane = pieces.plane_of_voxel[v];
    if (plane < 0) continue;
    bool front = false, back = false;
    for (int k = 0; k < 8; ++k) {
      const auto corner = static_cast<int>(voxelCorner(grid.corners, v, k));
      const float side =
          sideOf(grid.corners, pieces.planes[asSize(plane)], grid.corners.position(corner));
      front |= side > 0;
      back |= side < 0;
    }
    if (!front || !back)
      throwInput("{}: voxel {}: its plane {} does not pass through it", what, v, plane);
  }
}

}  // namespace

Vec3f Lattice::position(int index) const {
  const Vec3i step(index % count.x, index / count.x % count.y, index / (count.x * count.y));
  return first + Vec3f(step) * spacing;
}

Lattice makeLattice(const Box3f& box, const Vec3i& count) {
  Lattice lattice;
  lattice.count = count;
  const Vec3f edge = box.extent();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    PROBELAB_CHECK(count[axis] >= 1 && edge[axis] > 0);
    if (count[axis] == 1) {
      lattice.first[axis] = 0.5f * (box.min[axis] + box.max[axis]);
      lattice.spacing[axis] = edge[axis];
    } else {
      lattice.first[axis] = box.min[axis];
      lattice.spacing[axis] = edge[axis] / static_cast<float>(count[axis] - 1);
    }
  }
  return lattice;
}

std::size_t voxelCorner(const Lattice& corners, std::size_t voxel, int k) {
  const Vec3i at = gridPlace(corners.count - Vec3i(1, 1, 1), static_cast<int>(voxel));
  return asSize(
      gridIndex(corners.count, at.x + (k & 1), at.y + ((k >> 1) & 1), at.z + (k >> 2)));
}

VoxelPlace voxelAt(const Lattice& corners, const VoxelPieces& pieces, const Vec3f& p) {
  Vec3i low;
  Vec3f fraction;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int cells = corners.count[axis] - 1;
    const float at = std::clamp((p[axis] - corners.first[axis]) / corners.spacing[axis], 0.0f,
                                static_cast<float>(cells));
    low[axis] = std::min(static_cast<int>(at), cells - 1);
    fraction[axis] = at - static_cast<float>(low[axis]);
  }
  VoxelPlace place;
  place.voxel = asSize(gridIndex(corners.count - Vec3i(1, 1, 1), low.x, low.y, low.z));
  for (int k = 0; k < 8; ++k) {
    float share = 1;
    for (std::size_t axis = 0; axis < 3; ++axis)
      share *= (k >> axis & 1) != 0 ? fraction[axis] : 1 - fraction[axis];
    place.share[asSize(k)] = share;
  }
  place.piece = place.voxel;
  const int32_t plane = pieces.any() ? pieces.plane_of_voxel[place.voxel] : -1;
  if (plane < 0) return place;
  if (sideOf(corners, pieces.planes[asSize(plane)], p) < 0)
    place.piece = pieces.plane_of_voxel.size() + asSize(plane);
  return place;
}

uint8_t weightByte(float weight) {
  const long byte = std::lround(PL_WEIGHT_ONE * std::sqrt(static_cast<double>(weight)));
  return static_cast<uint8_t>(std::clamp(byte, 1L, 255L));
}

InfluenceGrid makeInfluence(const Lattice& corners, CornerWeights weights,
                            const std::vector<Vec3f>& positions, VoxelPieces pieces,
                            CornerScale scale) {
  for (std::size_t axis = 0; axis < 3; ++axis) PROBELAB_CHECK(corners.count[axis] >= 2);
  PROBELAB_CHECK(pieces.any() ? weights.size() >= asSize(corners.pointCount())
                              : weights.size() == asSize(corners.pointCount()));
  parallelFor(weights.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      mergeProbes(weights[i], positions.size());
      if (!weights[i].empty()) scaleCorner(weights[i], dropSmall(weights[i]), scale);
    }
  });
  if (std::all_of(weights.begin(), weights.end(), [](const auto& list) { return list.empty(); }))
    throwInput("no probe has a weight anywhere: ask for more probes or check the volume");
  fillEmptyCorners(weights, corners.count);

  InfluenceGrid grid;
  grid.corners = corners;
  grid.pieces.plane_of_voxel = pieces.plane_of_voxel;
  grid.pieces.planes = pieces.planes;
  grid.voxel_begin.push_back(0);
  const std::vector<std::size_t> voxel_of = voxelOfPiece(grid);
  for (std::size_t piece = 0; piece < voxel_of.size(); ++piece) {
    const std::vector<InfluenceEntry> entries = pieceEntries(grid, pieces, piece, weights);
    grid.entries.insert(grid.entries.end(), entries.begin(), entries.end());
    PROBELAB_CHECK(grid.entries.size() < std::numeric_limits<uint32_t>::max());
    grid.voxel_begin.push_back(static_cast<uint32_t>(grid.entries.size()));
    grid.nearest.push_back(
        nearestEntry(grid, piece, voxelMiddle(grid, voxel_of[piece]), positions));
  }
  return grid;
}

InfluenceGrid activeInfluence(const InfluenceGrid& grid, const std::vector<Vec3f>& positions,
                              const std::vector<uint8_t>& active) {
  PROBELAB_CHECK_EQ(active.size(), positions.size());
  InfluenceGrid result;
  result.corners = grid.corners;
  result.pieces = grid.pieces;
  result.voxel_begin.push_back(0);
  const std::vector<std::size_t> voxel_of = voxelOfPiece(grid);
  for (std::size_t piece = 0; piece < voxel_of.size(); ++piece) {
    for (uint32_t e = grid.voxel_begin[piece]; e < grid.voxel_begin[piece + 1]; ++e)
      if (active[grid.entries[e].probe] != 0) result.entries.push_back(grid.entries[e]);
    result.voxel_begin.push_back(static_cast<uint32_t>(result.entries.size()));
  }
  std::vector<uint32_t> all;
  for (std::size_t p = 0; p < active.size(); ++p)
    if (active[p] != 0) all.push_back(static_cast<uint32_t>(p));
  result.nearest.resize(voxel_of.size(), -1);
  parallelFor(result.nearest.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const Vec3f middle = voxelMiddle(grid, voxel_of[v]);
      int32_t nearest = nearestEntry(result, v, middle, positions);
      float best = std::numeric_limits<float>::infinity();
      if (nearest < 0)
        for (const uint32_t probe : all) {
          const float d = squaredDistance(positions[probe], middle);
          if (d < best) best = d, nearest = static_cast<int32_t>(probe);
        }
      result.nearest[v] = nearest;
    }
  });
  return result;
}

void validateInfluence(const InfluenceGrid& grid, std::size_t probes, const std::string& what) {
  const Lattice& corners = grid.corners;
  uint64_t voxels = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (corners.count[axis] < 2)
      throwInput("{}: the grid of corners has {} points along axis {}, must be 2 or more", what,
                 corners.count[axis], axis);
    if (!(std::isfinite(corners.first[axis]) && std::isfinite(corners.spacing[axis]) &&
          corners.spacing[axis] > 0))
      throwInput("{}: the grid of corners must be finite, with a spacing above 0", what);
    voxels *= static_cast<uint64_t>(corners.count[axis] - 1);
    if (voxels >= uint64_t{1} << 28)
      throwInput("{}: more than 2^28 voxels; use a coarser grid of corners", what);
  }
  checkPieces(grid, voxels, what);
  voxels += grid.pieces.planes.size();
  if (grid.voxel_begin.size() != voxels + 1 || grid.nearest.size() != voxels)
    throwInput("{}: the index has {} and {} entries for {} {}s", what, grid.voxel_begin.size(),
               grid.nearest.size(), voxels, pieceWord(grid));
  if (grid.voxel_begin.front() != 0 || grid.voxel_begin.back() != grid.entries.size() ||
      !std::is_sorted(grid.voxel_begin.begin(), grid.voxel_begin.end()))
    throwInput("{}: the {}s' first entries must rise from 0 to the number of entries, {}", what,
               pieceWord(grid), grid.entries.size());
  for (std::size_t v = 0; v < voxels; ++v) {
    if (grid.nearest[v] < 0 || static_cast<std::size_t>(grid.nearest[v]) >= probes)
      throwInput("{}: {} {}: nearest probe {} of {}", what, pieceWord(grid), v, grid.nearest[v],
                 probes);
    for (uint32_t e = grid.voxel_begin[v]; e < grid.voxel_begin[v + 1]; ++e) {
      const uint32_t probe = grid.entries[e].probe;
      if (probe >= probes)
        throwInput("{}: {} {}: probe {} of {}", what, pieceWord(grid), v, probe, probes);
      if (e > grid.voxel_begin[v] && grid.entries[e - 1].probe >= probe)
        throwInput("{}: {} {}: its probes must rise", what, pieceWord(grid), v);
    }
  }
  checkCornersAgree(grid, what);
}

uint64_t influenceBytes(const InfluenceGrid& grid) {
  return grid.voxel_begin.size() * sizeof(uint32_t) +
         grid.entries.size() * sizeof(InfluenceEntry) +
         grid.pieces.plane_of_voxel.size() * sizeof(int32_t) +
         grid.pieces.planes.size() * sizeof(Vec4f);
}

}  // namespace probelab
