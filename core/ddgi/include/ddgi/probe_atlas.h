// SPDX-License-Identifier: Apache-2.0
// The texels of all probes on the device. Two copies: an update reads one and writes the other.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "ddgi/params.h"
#include "ddgi/stage.h"

namespace probelab {

enum class AtlasKind { irradiance, moments };

struct ProbeAtlas {
  AtlasKind kind = AtlasKind::irradiance;
  int texels = 0;  // interior, a side
  int border = 0;
  int format = 0, encoding = 0;
  uint64_t probes = 0;
  std::array<GpuBuffer, 2> copies;
  GpuBuffer average;  // [interior texel][probe], linear; empty unless averages are kept
  uint32_t side() const { return static_cast<uint32_t>(texels + 2 * border); }
};

ProbeAtlas makeAtlas(GpuContext& context, AtlasKind kind, const Params& params, uint64_t probes,
                     bool accumulate);

// Texels of one copy as stored, [probe][y][x], side() squared a probe: encoded irradiance; mean and
// mean square of the distance in units of r_i.
std::vector<Vec3f> downloadIrradiance(GpuContext& context, const ProbeAtlas& atlas, int copy);
std::vector<Vec2f> downloadMoments(GpuContext& context, const ProbeAtlas& atlas, int copy);

// Writes the irradiance texels of one copy, in the order of downloadIrradiance, rounded to nearest.
// Returns how many are beyond the format's largest number and were stored as that.
uint32_t uploadIrradiance(GpuContext& context, ProbeAtlas& atlas, int copy,
                          std::span<const Vec3f> texels);

// Formats and layout as the stages know them.
Defines atlasDefines(const Params& params);

}  // namespace probelab
