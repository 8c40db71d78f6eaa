// SPDX-License-Identifier: GPL-3.0-or-later
// Where probes may be: tests of places and lines by rays, and random places in free space.
#pragma once

#include <optional>
#include <vector>

#include "base/rng.h"
#include "placement/strategy.h"

namespace probelab {

// Whether a point is enclosed by solid geometry: more than half of the rays in 32 fixed directions
// meet the back of a single-sided face first. That holds for open, overlapping and non-manifold
// meshes, where counting crossings does not; a closed double-sided mesh has no inside by it, but
// what lies in it is not reachable.
bool isInsideSolid(const Scene& scene, const EmbreeScene& embree, const Vec3f& p);

// Whether nothing lies between two points, looked at from both ends.
bool isLineFree(const EmbreeScene& embree, const Vec3f& a, const Vec3f& b);

// Whether a probe may be there: reachable, and not inside solid geometry (unless all of its region
// looks so, as in a room whose faces are turned outward).
bool isUsable(const PlacementInput& input, const Vec3f& p);

// The places where isUsable holds, to draw from. Keeps the input.
class FreeSpace {
 public:
  // Throws InputError when there is no usable place.
  explicit FreeSpace(const PlacementInput& input);

  const PlacementInput& input() const { return input_; }
  bool usable(const Vec3f& p) const { return isUsable(input_, p); }
  bool lineFree(const Vec3f& a, const Vec3f& b) const { return isLineFree(input_.embree, a, b); }
  double volume() const { return volume_m3_; }  // cubic metres, estimated by 4,096 samples
  double spacing(int probes) const;             // (volume / probes)^(1/3), metres

  // A place in the cells that make up or border on the free space, uniform by volume: usable() is
  // yet to be asked.
  Vec3f candidate(Rng& rng) const;
  // A usable place, uniform by volume.
  Vec3f sample(Rng& rng) const;
  // The first of `tries` uniform places in the box that is usable.
  std::optional<Vec3f> sampleIn(const Box3f& box, Rng& rng, int tries) const;
  // A usable place far from occupied cells: the middle of a free cell.
  const Vec3f& roomiest() const { return roomiest_; }

 private:
  const PlacementInput& input_;
  std::vector<int32_t> cells_;  // of the reachability's grid, in which usable places may lie
  double volume_m3_ = 0;
  Vec3f roomiest_;
};

}  // namespace probelab
