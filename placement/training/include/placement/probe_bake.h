// SPDX-License-Identifier: GPL-3.0-or-later
// What a probe at a place would hold, under every training state, without feedback: irradiance of
// the patches and moments of the distance, in texels as the field's parameters ask for.
#pragma once

#include <span>
#include <vector>

#include "ddgi/layout.h"
#include "ddgi/params.h"
#include "ddgi/weight_table.h"
#include "placement/patch_cache.h"

namespace probelab {

inline constexpr int kSearchRays = 256;  // of a probe that a search tries
inline constexpr int kScoreRays = 1024;  // of a layout's probe

struct BakedProbe {
  Vec3f position;
  std::vector<float> mean_radiance;  // [interior texel][state], luminance: irradiance / pi
  std::vector<Vec2f> moments;        // [interior texel] of the distance in metres; or empty
};

// How all probes of a bake gather: directions and the texels' weights.
struct BakePlan {
  std::vector<Vec3f> directions;
  WeightTable irradiance, moments;
  int irradiance_texels = 0, moment_texels = 0;  // interior, a side; 0: no visibility
  float backface_shortening = 1;
  float distance_clamp_m = 0;
};
BakePlan makeBakePlan(const Params& params, int rays, float distance_clamp_m, uint64_t seed);

// [position]; parallel. Distances are held to the plan's clamp, or to one of its own for each.
std::vector<BakedProbe> bakeProbes(const PatchCache& patches, const BakePlan& plan,
                                   std::span<const Vec3f> positions,
                                   std::span<const float> distance_clamps_m = {});

// Every probe of a layout, with kScoreRays and the clamp of its own support radius.
struct LayoutBake {
  BakePlan plan;
  std::vector<BakedProbe> probes;
};
LayoutBake bakeLayout(const PatchCache& patches, const ProbeLayout& layout, const Params& params,
                      uint64_t seed);

}  // namespace probelab
