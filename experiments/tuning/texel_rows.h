// SPDX-License-Identifier: GPL-3.0-or-later
// How a query's answer changes with each texel that it reads: the shared query runs on a number
// that carries its derivative by texels.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "ddgi/snapshot.h"

namespace probelab {

// The unknowns of a field: interior texels, [probe][y][x]. A border's texel is the interior one
// that it repeats. [place in a probe's stored tile] -> interior texel.
std::vector<int> interiorTexels(int texels, int border);

struct TexelSlope {
  uint32_t texel = 0;  // probe * interior texels a probe + interior texel
  double slope = 0;    // of irradiance by the stored value
};

// Of one channel at one point.
struct TexelRow {
  double irradiance = 0;
  std::vector<TexelSlope> slopes;  // by ascending texel, each once
};

// [point][channel]; channels do not mix. `stored` replaces the field's irradiance texels. Where a
// root's slope is infinite (a texel of 0) it is taken as 0. Parallel and deterministic.
std::vector<std::array<TexelRow, 3>> texelRows(const FieldSnapshot& field,
                                               std::span<const Vec3f> stored, const Params& params,
                                               std::span<const QueryPoint> points);

}  // namespace probelab
