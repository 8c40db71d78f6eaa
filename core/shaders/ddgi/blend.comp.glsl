// SPDX-License-Identifier: Apache-2.0
// Rays -> texels ([M19], [RTXGI]). An invocation takes a few probes and a block of texels, all
// invocations of a workgroup the same block, so that the rays and weights of the block
// (ddgi/weight_table.h) are the same for all of them. PL_BLEND 0: irradiance, as mean radiance under the cosine, encoded; 1:
// mean and mean square of the radial distance in units of r_i. Each texel also writes the border
// texels that repeat it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/texels.glsl"
#include "shared/octahedral.h"

BUFFER(BIND_BLOCK_BEGIN, readonly, BlockBegin, uint block_begin[]);     // [block + 1] in entries
BUFFER(BIND_BLOCK_TEXELS, readonly, BlockTexels, uint block_texels[]);  // [block][kBlock]
BUFFER(BIND_ENTRY_RAYS, readonly, EntryRays, uint entry_rays[]);        // [entry]
BUFFER(BIND_WEIGHTS, readonly, Weights, float weights[]);               // [entry][kBlock]
#if PL_PROBE_LIST
BUFFER(BIND_PROBE_LIST, readonly, ProbeList, uint probe_list[]);
#endif
#if PL_PROBE_CLAMP
BUFFER(BIND_PROBE_CLAMPS, readonly, ProbeClamps, float probe_clamps[]);  // [probe], as distances
#endif
BUFFER(BIND_COUNTERS, restrict, CounterBuffer, CounterData counters);

layout(push_constant, scalar) uniform Push {
  RayItems items;
  BlendConstants blend;
#if PL_BLEND == 0
  Vec4Array rays;    // radiance, signed distance
#else
  FloatArray rays;   // distance in units of r_i
#endif
  WordArray previous;
  WordOutput atlas;
  Vec3InOut average;  // [interior texel][probe], linear
  uint probe_total;
  uint ray_count;
} push;

const uint kBlock = PL_BLOCK;
const uint kProbes = PL_PROBES;  // of an invocation
const uint kNoTexel = 0xffffffffu;

#if PL_BLEND == 0
vec3 loadTexel(uint texel) { return loadIrradiance(push.previous, texel); }
#if PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA32F
const float kLargest = 3.4e38;
void storeTexel(uint texel, vec3 value, uint rounding) {
  push.atlas.at[texel * 4u] = floatBitsToUint(value.x);
  push.atlas.at[texel * 4u + 1u] = floatBitsToUint(value.y);
  push.atlas.at[texel * 4u + 2u] = floatBitsToUint(value.z);
}
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA16F
const float kLargest = 65504.0;
void storeTexel(uint texel, vec3 value, uint rounding) {
  push.atlas.at[texel * 2u] = packHalfPair(value.x, value.y, rounding);
  push.atlas.at[texel * 2u + 1u] =
      packHalfFloat(value.z, rounding == kRoundToNearest ? rounding : ditherHash(~rounding));
}
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_R11G11B10F
const float kLargest = 64512.0;  // of the blue channel
void storeTexel(uint texel, vec3 value, uint rounding) {
  push.atlas.at[texel] = packR11G11B10(value, rounding);
}
#else
const float kLargest = 1.0;
void storeTexel(uint texel, vec3 value, uint rounding) {
  push.atlas.at[texel] = packRgb10A2(value, rounding);
}
#endif

vec3 encodeTexel(vec3 mean) {
#if PL_ENCODED
  return pow(mean, vec3(1.0 / push.blend.gamma));
#else
  return mean;
#endif
}
vec3 decodeTexel(vec3 stored) {
#if PL_ENCODED
  return pow(stored, vec3(push.blend.gamma));
#else
  return stored;
#endif
}
#else
vec3 loadTexel(uint texel) { return vec3(loadMoments(push.previous, texel), 0.0); }
const float kLargest = PL_MOMENT_FORMAT == PL_FORMAT_RG32F ? 3.4e38 : 65504.0;
void storeTexel(uint texel, vec3 value, uint rounding) {
#if PL_MOMENT_ENCODING == PL_MOMENTS_CENTRAL
  value.y = sqrt(max(value.y - value.x * value.x, 0.0));
#endif
#if PL_MOMENT_FORMAT == PL_FORMAT_RG32F
  push.atlas.at[texel * 2u] = floatBitsToUint(value.x);
  push.atlas.at[texel * 2u + 1u] = floatBitsToUint(value.y);
#else
  push.atlas.at[texel] = packHalfPair(value.x, value.y, rounding);
#endif
}
vec3 encodeTexel(vec3 mean) { return mean; }
vec3 decodeTexel(vec3 stored) { return stored; }
#endif

// Writes interior texel (x, y) of a probe and, with a border, its copies there: the map's neighbour
// across an edge is the texel mirrored along that edge, across a corner the opposite corner.
void storeWithBorder(uint probe, uint x, uint y, vec3 value, uint rounding) {
  uint n = push.blend.texels;
#if !PL_BORDER
  storeTexel((probe * n + y) * n + x, value, rounding);
#else
  uint size = n + 2u;
  uint base = probe * size * size;
  storeTexel(base + (y + 1u) * size + x + 1u, value, rounding);
  bool edge_x = x == 0u || x == n - 1u;
  bool edge_y = y == 0u || y == n - 1u;
  if (edge_y) storeTexel(base + (y == 0u ? 0u : n + 1u) * size + (n - x), value, rounding);
  if (edge_x) storeTexel(base + (n - y) * size + (x == 0u ? 0u : n + 1u), value, rounding);
  if (n == 1u) {
    // One texel is edge and corner on every side.
    for (uint i = 0u; i < 9u; ++i) storeTexel(base + i, value, rounding);
  } else if (edge_x && edge_y) {
    storeTexel(base + (y == 0u ? n + 1u : 0u) * size + (x == 0u ? n + 1u : 0u), value, rounding);
  }
#endif
}

// Share of the history that stays where the light has changed, and what becomes of the new value.
#if PL_BLEND == 0 && PL_CHANGE != PL_CHANGE_NONE
float changedHysteresis(vec3 before, inout vec3 after) {
  BlendConstants blend = push.blend;
#if PL_CHANGE == PL_CHANGE_M21
  vec3 larger = max(max(before, after), vec3(1e-6));
  vec3 change = abs(after - before) / larger;
  float most = max(change.x, max(change.y, change.z));
  if (most > blend.reset_threshold) return 0.0;
  return most > blend.change_threshold ? max(blend.hysteresis - blend.change_drop, 0.0)
                                       : blend.hysteresis;
#else
  // [RTXGI] compares what it stores, which is half as bright.
  float scale = pow(0.5, 1.0 / blend.gamma);
  vec3 darker = (before - after) * scale;
  float h = blend.hysteresis;
  if (dot(before, before) == 0.0) h = 0.0;  // a texel that was black counts as a first write
  if (max(darker.x, max(darker.y, darker.z)) > blend.change_threshold)
    h = max(h - blend.change_drop, 0.0);
  if (-dot(darker, vec3(0.2126, 0.7152, 0.0722)) > blend.brightness_threshold)
    after = before + (after - before) * 0.25;
  return h;
#endif
}
#endif

// The history and this update's value, both encoded.
vec3 mixWithHistory(vec3 before, vec3 after) {
  float h = push.blend.hysteresis;
#if PL_BLEND == 0 && PL_CHANGE != PL_CHANGE_NONE
  h = changedHysteresis(before, after);
#endif
#if PL_BLEND == 0 && PL_LINEAR_HISTORY
  return encodeTexel(mix(decodeTexel(after), decodeTexel(before), h));
#elif PL_BLEND == 0 && PL_CHANGE == PL_CHANGE_RTXGI
  vec3 delta = after - before;
  vec3 step = (1.0 - h) * delta;
  if (max(after.x, max(after.y, after.z)) < max(before.x, max(before.y, before.z))) {
    float least = push.blend.darkening_step * pow(2.0, 1.0 / push.blend.gamma);
    step = min(max(vec3(least), abs(step)), abs(delta)) * sign(step);
  }
  return before + step;
#else
  return mix(after, before, h);
#endif
}

// `sum`: the weighted mean, with the share of the weight that counted in w.
void finishTexel(uint probe, uint texel, vec4 sum, bool frozen) {
  BlendConstants blend = push.blend;
  uint x = texel % blend.texels;
  uint y = texel / blend.texels;
  uint side = blend.texels + 2u * PL_BORDER;
  uint stored_at = (probe * side + y + PL_BORDER) * side + x + PL_BORDER;
  bool counts = sum.w > 0.05 && !frozen;
  vec3 mean = counts ? max(sum.rgb / sum.w, vec3(0.0)) : vec3(0.0);
  vec3 value = encodeTexel(mean);
  if (!counts) {
    value = loadTexel(stored_at);  // too few rays count for this texel: it keeps what it had
  } else if (blend.hysteresis > 0.0) {
    value = mixWithHistory(loadTexel(stored_at), value);
  }
#if PL_ACCUMULATE
  uint at = texel * push.probe_total + probe;
  vec3 running = mean;
  if (blend.accumulate < 1.0)
    running = counts ? push.average.at[at] + (mean - push.average.at[at]) * blend.accumulate
                     : push.average.at[at];
  push.average.at[at] = running;
  if (blend.store_average != 0u) value = encodeTexel(running);
#endif
  if (max(value.x, max(value.y, value.z)) > kLargest) atomicAdd(counters.clamped_texels, 1u);
  uint rounding = kRoundToNearest;
#if PL_DITHER
  if (blend.store_average == 0u) rounding = ditherHash(stored_at + ditherHash(blend.dither));
#endif
  storeWithBorder(probe, x, y, value, rounding);
}

#if PL_BLEND == 0
// What a ray brings, and in w whether it counts. `largest`: the probe's clamp of the distance.
vec4 contribution(uint item, float largest) {
  vec4 value = push.rays.at[item];
#if PL_BACKFACE_SKIP
  return value.w < 0.0 ? vec4(0.0) : vec4(value.rgb, 1.0);
#else
  return vec4(value.rgb, 1.0);
#endif
}
#elif PL_PROBE_CLAMP
vec4 contribution(uint item, float largest) {
  float r = min(push.rays.at[item], largest);
  return vec4(r, r * r, 0.0, 1.0);
}
#else
vec4 contribution(uint item, float largest) {
  float r = push.rays.at[item];
  return vec4(r, r * r, 0.0, 1.0);
}
#endif

#if PL_BACKFACE_FREEZE
bool isFrozen(uint first_item, uint ray_count) {
  uint back = 0u;
  for (uint r = 0u; r < ray_count; ++r)
    back += push.rays.at[first_item + r * push.items.stride_ray].w < 0.0 ? 1u : 0u;
  return float(back) > push.blend.backface_freeze * float(ray_count);
}
#endif

// Probe number q of this invocation, counted in the batch.
uint probeOfBatch(uint q) {
  return (gl_WorkGroupID.y * kProbes + q) * kGroupSize + gl_LocalInvocationID.x;
}

// Probe number p of the batch, among all probes.
uint storedProbe(uint p) {
  uint probe = push.items.first_probe + p;
#if PL_PROBE_LIST
  probe = probe_list[probe];
#endif
  return probe;
}

void finishSum(uint i, uint texel, vec4 sum, bool frozen) {
  uint p = probeOfBatch(i / kBlock);
  if (p >= push.items.probe_count || texel == kNoTexel) return;
  uint probe = storedProbe(p);
#if !(PL_BLEND == 0 && PL_BACKFACE_SKIP)
  sum.w = 1.0;  // weights are normalised and every ray counts
#endif
  finishTexel(probe, texel, sum, frozen);
}

void main() {
  uint block = gl_WorkGroupID.x;
  uint begin = block_begin[block];
  uint end = block_begin[block + 1u];
  uint first_item[kProbes];
  vec4 sums[kProbes * kBlock];
  [[unroll]] for (uint q = 0u; q < kProbes; ++q) {
    first_item[q] = min(probeOfBatch(q), push.items.probe_count - 1u) * push.items.stride_probe;
    [[unroll]] for (uint k = 0u; k < kBlock; ++k) sums[q * kBlock + k] = vec4(0.0);
  }
  float largest[kProbes];
  [[unroll]] for (uint q = 0u; q < kProbes; ++q) {
    largest[q] = 0.0;
#if PL_PROBE_CLAMP
    largest[q] = probe_clamps[storedProbe(min(probeOfBatch(q), push.items.probe_count - 1u))];
#endif
  }
  for (uint e = begin; e < end; ++e) {
    uint ray = entry_rays[e] * push.items.stride_ray;
    vec4 values[kProbes];
    [[unroll]] for (uint q = 0u; q < kProbes; ++q) values[q] = contribution(first_item[q] + ray, largest[q]);
    [[unroll]] for (uint k = 0u; k < kBlock; ++k) {
      float weight = weights[e * kBlock + k];
      [[unroll]] for (uint q = 0u; q < kProbes; ++q)
        sums[q * kBlock + k] += values[q] * weight;
    }
  }
  bool frozen[kProbes];
  [[unroll]] for (uint q = 0u; q < kProbes; ++q) {
    frozen[q] = false;
#if PL_BACKFACE_FREEZE
    frozen[q] = isFrozen(first_item[q], push.ray_count);
#endif
  }
  // A copy that a loop may index, so that the sums above stay in registers.
  vec4 finished[kProbes * kBlock];
  [[unroll]] for (uint i = 0u; i < kProbes * kBlock; ++i) finished[i] = sums[i];
  [[dont_unroll]] for (uint i = 0u; i < kProbes * kBlock; ++i)
    finishSum(i, block_texels[block * kBlock + i % kBlock], finished[i], frozen[i / kBlock]);
}
