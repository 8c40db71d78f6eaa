// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/free_space.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "base/error.h"
#include "shared/light.h"
#include "trace/sampling.h"
#include "trace/surface.h"

namespace probelab {
namespace {

constexpr int kDirections = 32;
constexpr int kFirstLook = 8;  // without a back face in as many directions the rest is spared
constexpr int kVolumeSamples = 4096;
constexpr int kSampleTries = 100000;

// Spherical Fibonacci points, in an order in which any run of them is spread over the sphere.
const std::array<Vec3f, kDirections>& fixedDirections() {
  static const std::array<Vec3f, kDirections> directions = [] {
    std::array<Vec3f, kDirections> d;
    for (int i = 0; i < kDirections; ++i) {
      const int j = i * 13 % kDirections;  // 13 and 32 have no common factor
      const float turn = 0.61803398875f * static_cast<float>(j);
      d[static_cast<std::size_t>(i)] =
          sampleSphere({(static_cast<float>(j) + 0.5f) / kDirections, turn - std::floor(turn)});
    }
    return d;
  }();
  return directions;
}

const Region* regionAt(const PlacementInput& input, const Vec3f& p) {
  const int region = regionOf(input.reachability, input.embree, p);
  return region < 0 ? nullptr : &input.reachability.regions[static_cast<std::size_t>(region)];
}

bool isReachableCell(const Reachability& grid, std::size_t cell) {
  const int32_t region = grid.cell_region[cell];
  return region >= 0 && grid.regions[static_cast<std::size_t>(region)].reachable;
}

}  // namespace

bool isInsideSolid(const Scene& scene, const EmbreeScene& embree, const Vec3f& p) {
  int backs = 0;
  for (int i = 0; i < kDirections; ++i) {
    if (i == kFirstLook && backs == 0) return false;
    const Vec3f& direction = fixedDirections()[static_cast<std::size_t>(i)];
    const Hit hit = embree.closest(Ray{p, 0, direction, kFarDistance});
    if (hit.primitive == kNoHit) continue;
    const Triangle& triangle = scene.geometry->triangles[hit.primitive];
    if (!scene.materials[triangle.material].double_sided &&
        dot(faceNormal(*scene.geometry, hit.primitive), direction) > 0)
      ++backs;
  }
  return 2 * backs > kDirections;
}

bool isLineFree(const EmbreeScene& embree, const Vec3f& a, const Vec3f& b) {
  const Vec3f way = b - a;
  const float distance_m = length(way);
  if (!(distance_m > 0)) return true;
  const Vec3f direction = way / distance_m;
  return !embree.occluded(Ray{a, 0, direction, distance_m}) &&
         !embree.occluded(Ray{b, 0, -direction, distance_m});
}

bool isUsable(const PlacementInput& input, const Vec3f& p) {
  const Region* region = regionAt(input, p);
  if (!region || !region->reachable) return false;
  return region->inside_solid || !isInsideSolid(input.scene, input.embree, p);
}

FreeSpace::FreeSpace(const PlacementInput& input) : input_(input) {
  const Reachability& grid = input.reachability;
  const Vec3f margin = grid.cell_size;
  const Box3f box{grid.reachable_box.min - margin, grid.reachable_box.max + margin};
  // How many free cells lie around a cell, to both sides along every axis.
  const auto room = [&](std::size_t cell) {
    const Vec3i n = grid.resolution;
    const int stride[3] = {1, n.x, n.x * n.y};
    const int at[3] = {static_cast<int>(cell) % n.x, static_cast<int>(cell) / n.x % n.y,
                       static_cast<int>(cell) / (n.x * n.y)};
    int least = 1 << 30;
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const int step : {-1, 1}) {
        int free = 0;
        for (int c = at[axis] + step; c >= 0 && c < n[axis]; c += step, ++free)
          if (!isReachableCell(grid, cell + static_cast<std::size_t>(static_cast<std::ptrdiff_t>(
                                                (c - at[axis]) * stride[axis]))))
            break;
        least = std::min(least, free);
      }
    return least;
  };
  int most_room = -1;
  std::size_t seen = 0;
  const std::size_t every = std::max<std::size_t>(1, grid.cell_region.size() / 4096);
  for (std::size_t i = 0; i < grid.cell_region.size(); ++i) {
    const bool reachable = isReachableCell(grid, i);
    if (!reachable && (grid.cell_region[i] != kOccupiedCell ||
                       !box.contains(grid.cellCenter(static_cast<int32_t>(i)))))
      continue;
    cells_.push_back(static_cast<int32_t>(i));
    if (!reachable || (most_room >= 0 && seen++ % every != 0)) continue;
    const int here = room(i);
    if (here <= most_room || !usable(grid.cellCenter(static_cast<int32_t>(i)))) continue;
    most_room = here;
    roomiest_ = grid.cellCenter(static_cast<int32_t>(i));
  }
  if (most_room < 0)
    throwInput("{}: no free space for probes within the volume; check [volume] and the cameras",
               input.scene.path);
  int usable_samples = 0;
  for (int i = 0; i < kVolumeSamples; ++i) {
    Rng rng(0, RngStream::placement, 0, static_cast<uint64_t>(i));
    if (usable(candidate(rng))) ++usable_samples;
  }
  const Vec3d cell(grid.cell_size);
  volume_m3_ = std::max(usable_samples, 1) / static_cast<double>(kVolumeSamples) *
               static_cast<double>(cells_.size()) * cell.x * cell.y * cell.z;
}

double FreeSpace::spacing(int probes) const { return std::cbrt(volume_m3_ / probes); }

Vec3f FreeSpace::candidate(Rng& rng) const {
  Vec3f p = input_.reachability.cellCenter(cells_[rng.nextBelow(cells_.size())]);
  for (std::size_t axis = 0; axis < 3; ++axis)
    p[axis] += (rng.nextFloat() - 0.5f) * input_.reachability.cell_size[axis];
  return p;
}

Vec3f FreeSpace::sample(Rng& rng) const {
  for (int i = 0; i < kSampleTries; ++i) {
    const Vec3f p = candidate(rng);
    if (usable(p)) return p;
  }
  return roomiest_;
}

std::optional<Vec3f> FreeSpace::sampleIn(const Box3f& box, Rng& rng, int tries) const {
  for (int i = 0; i < tries; ++i) {
    Vec3f p;
    for (std::size_t axis = 0; axis < 3; ++axis)
      p[axis] = box.min[axis] + rng.nextFloat() * (box.max[axis] - box.min[axis]);
    if (usable(p)) return p;
  }
  return std::nullopt;
}

}  // namespace probelab
