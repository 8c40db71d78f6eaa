// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/probe_bake.h"

#include <algorithm>
#include <cmath>

#include "base/interrupt.h"
#include "base/parallel.h"
#include "ddgi/directions.h"

namespace probelab {
namespace {

BakedProbe blendRays(const PatchCache& patches, const BakePlan& plan, const Vec3f& position,
                     float distance_clamp_m, std::span<const RaySample> samples) {
  const std::size_t states = patches.stateCount(), rays = samples.size();
  std::vector<float> radiance(rays * states, 0.0f);
  for (std::size_t r = 0; r < rays; ++r)
    patches.addRadiance(samples[r], 1, 1, std::span<float>(radiance).subspan(r * states, states));
  BakedProbe probe;
  probe.position = position;
  const auto each = [](const WeightTable& table, auto&& add) {
    for (std::size_t t = 0; t + 1 < table.block_begin.size(); ++t)
      for (uint32_t e = table.block_begin[t]; e < table.block_begin[t + 1]; ++e)
        add(table.block_texels[t], table.entry_rays[e], table.weights[e]);
  };
  const auto texels = static_cast<std::size_t>(plan.irradiance_texels * plan.irradiance_texels);
  probe.mean_radiance.assign(texels * states, 0.0f);
  each(plan.irradiance, [&](uint32_t texel, uint32_t ray, float weight) {
    float* sum = &probe.mean_radiance[texel * states];
    const float* from = &radiance[ray * states];
    for (std::size_t l = 0; l < states; ++l) sum[l] += weight * from[l];
  });
  for (float& v : probe.mean_radiance) v = std::max(v, 0.0f);
  if (plan.moment_texels == 0) return probe;
  std::vector<float> distance(rays);
  for (std::size_t r = 0; r < rays; ++r) {
    const float d = samples[r].distance_m;
    distance[r] = std::min(d < 0 ? -d * plan.backface_shortening : d, distance_clamp_m);
  }
  probe.moments.assign(static_cast<std::size_t>(plan.moment_texels * plan.moment_texels), Vec2f());
  each(plan.moments, [&](uint32_t texel, uint32_t ray, float weight) {
    const float d = distance[ray];
    probe.moments[texel] += Vec2f(d, d * d) * weight;
  });
  return probe;
}

}  // namespace

BakePlan makeBakePlan(const Params& params, int rays, float distance_clamp_m, uint64_t seed) {
  BakePlan plan;
  plan.directions = updateDirections(rays, seed, 0);
  const AtlasSides sides = atlasSides(params);
  plan.irradiance_texels = sides.irradiance;
  plan.irradiance = makeWeightTable(plan.directions, {sides.irradiance, 1, nullptr}, 1);
  plan.backface_shortening = static_cast<float>(params.backface_shortening);
  plan.distance_clamp_m = distance_clamp_m;
  if (params.visibility == 0) return plan;
  plan.moment_texels = sides.moments;
  plan.moments = makeWeightTable(plan.directions, {sides.moments, params.distance_exponent}, 1);
  return plan;
}

std::vector<BakedProbe> bakeProbes(const PatchCache& patches, const BakePlan& plan,
                                   std::span<const Vec3f> positions,
                                   std::span<const float> distance_clamps_m) {
  std::vector<BakedProbe> probes(positions.size());
  const std::size_t rays = plan.directions.size();
  parallelFor(positions.size(), 8, [&](std::size_t begin, std::size_t end) {
    throwIfInterrupted();
    std::vector<Ray> batch;
    for (std::size_t p = begin; p < end; ++p)
      for (const Vec3f& d : plan.directions) batch.push_back(Ray{positions[p], 0, d, kFarDistance});
    std::vector<RaySample> samples(batch.size());
    patches.trace(batch, samples);
    for (std::size_t p = begin; p < end; ++p)
      probes[p] =
          blendRays(patches, plan, positions[p],
                    distance_clamps_m.empty() ? plan.distance_clamp_m : distance_clamps_m[p],
                    std::span(samples).subspan((p - begin) * rays, rays));
  });
  return probes;
}

LayoutBake bakeLayout(const PatchCache& patches, const ProbeLayout& layout, const Params& params,
                      uint64_t seed) {
  LayoutBake bake{makeBakePlan(params, kScoreRays, 0, seed), {}};
  std::vector<float> clamps;
  for (std::size_t p = 0; p < layout.positions.size(); ++p)
    clamps.push_back(static_cast<float>(params.distance_clamp) * probeLengths(layout, p).support);
  bake.probes = bakeProbes(patches, bake.plan, layout.positions, clamps);
  return bake;
}

}  // namespace probelab
