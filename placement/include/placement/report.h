// SPDX-License-Identifier: GPL-3.0-or-later
// What a layout looks like, without rendering anything.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "placement/strategy.h"

namespace probelab {

struct Spread {
  double min = 0, p5 = 0, median = 0, p95 = 0, max = 0;
};

struct LayoutReport {
  uint64_t stored = 0;           // probes that own texels
  uint64_t inside_geometry = 0;  // of them; see isInsideSolid
  uint64_t pinned = 0;
  bool has_clearance = false;  // there are triangles, and the build has CGAL
  Spread clearance_m;          // metres to the nearest surface
  Spread spacing_m;            // metres to the nearest other probe; all 0 for a single probe
  // Share of the points that at least kReached[i] probes reach: their interpolation weight there is
  // above 0 and they see the point. The first one is the share that none reaches.
  static constexpr std::array<int, 5> kReached = {0, 1, 2, 4, 8};
  std::array<double, 5> reached{};
  uint64_t index_bytes = 0;
  double build_s = 0;
  uint64_t evaluations = 0;
};

// `points`: receivers, on or off surfaces, in local coordinates.
LayoutReport layoutReport(const ProbeLayout& layout, const Scene& scene, const EmbreeScene& embree,
                          std::span<const Vec3f> points);

// The probes with interpolation weights above 0 at a place in the bounds, with those weights.
std::vector<CornerWeight> weightsAt(const ProbeLayout& layout, const Vec3f& p);

}  // namespace probelab
