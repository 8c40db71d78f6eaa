// SPDX-License-Identifier: Apache-2.0
// Rays -> texels, one invocation a texel of kProbes probes ([M19], [RTXGI]; the weights come from one
// table, since all probes share their directions). PL_BLEND 0: irradiance, as mean radiance under the
// cosine, encoded; 1: mean and mean square of the radial distance in units of r_i. Each texel also
// writes the border texels that repeat it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"
#include "shared/atlas_format.h"

BUFFER(BIND_RADIANCE, readonly, Radiance, vec4 radiance[]);
BUFFER(BIND_WEIGHTS, readonly, Weights, float weights[]);
BUFFER(BIND_PREVIOUS, readonly, Previous, uint previous[]);
BUFFER(BIND_ATLAS, writeonly, Atlas, uint atlas[]);
BUFFER(BIND_COUNTERS, restrict, CounterBuffer, Counters counters);
#if PL_ACCUMULATE
BUFFER(BIND_AVERAGE, restrict, Average, vec3 average[]);  // linear, interior texels
#endif

layout(push_constant, scalar) uniform Push {
  uint item_count;
  uint texels;  // interior texels a side
  BlendConstants blend;
} push;

const uint kProbes = 4u;

#if PL_BLEND == 0
vec3 loadTexel(uint texel) {
#if PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA32F
  return vec3(uintBitsToFloat(previous[texel * 4u]), uintBitsToFloat(previous[texel * 4u + 1u]),
              uintBitsToFloat(previous[texel * 4u + 2u]));
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA16F
  uint rg = previous[texel * 2u];
  return vec3(unpackHalfFloat(rg & 0xffffu), unpackHalfFloat(rg >> 16u),
              unpackHalfFloat(previous[texel * 2u + 1u] & 0xffffu));
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_R11G11B10F
  return unpackR11G11B10(previous[texel]);
#else
  return unpackRgb10A2(previous[texel]);
#endif
}
void storeTexel(uint texel, vec3 value) {
#if PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA32F
  atlas[texel * 4u] = floatBitsToUint(value.x);
  atlas[texel * 4u + 1u] = floatBitsToUint(value.y);
  atlas[texel * 4u + 2u] = floatBitsToUint(value.z);
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA16F
  atlas[texel * 2u] = packHalfPair(value.x, value.y);
  atlas[texel * 2u + 1u] = packHalfPair(value.z, 0.0);
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_R11G11B10F
  atlas[texel] = packR11G11B10(value);
#else
  atlas[texel] = packRgb10A2(value);
#endif
}
#if PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA32F
const float kLargest = 3.4e38;
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_RGB10A2
const float kLargest = 1.0;
#else
const float kLargest = 65024.0;
#endif
// What a ray adds: radiance, or nothing where the back faces are left out.
vec4 contribution(vec4 ray) {
  return push.blend.backface_skip != 0u && ray.w < 0.0 ? vec4(0.0) : vec4(ray.rgb, 1.0);
}
vec3 encodeTexel(vec3 mean) {
  if (push.blend.encode_exponent == 1.0) return mean;
  return pow(mean, vec3(push.blend.encode_exponent));
}
#else
vec3 loadTexel(uint texel) {
#if PL_MOMENT_FORMAT == PL_FORMAT_RG32F
  return vec3(uintBitsToFloat(previous[texel * 2u]), uintBitsToFloat(previous[texel * 2u + 1u]), 0.0);
#else
  uint pair = previous[texel];
  return vec3(unpackHalfFloat(pair & 0xffffu), unpackHalfFloat(pair >> 16u), 0.0);
#endif
}
void storeTexel(uint texel, vec3 value) {
#if PL_MOMENT_FORMAT == PL_FORMAT_RG32F
  atlas[texel * 2u] = floatBitsToUint(value.x);
  atlas[texel * 2u + 1u] = floatBitsToUint(value.y);
#else
  atlas[texel] = packHalfPair(value.x, value.y);
#endif
}
const float kLargest = PL_MOMENT_FORMAT == PL_FORMAT_RG32F ? 3.4e38 : 65504.0;
vec4 contribution(vec4 ray) {
  float distance_m = ray.w < 0.0 ? -ray.w * push.blend.backface_shortening : ray.w;
  float r = min(distance_m * push.blend.distance_scale, push.blend.distance_clamp);
  return vec4(r, r * r, 0.0, 1.0);
}
vec3 encodeTexel(vec3 mean) { return mean; }
#endif

// Writes interior texel (x, y) of a probe and its copies in the border: the map's neighbour across
// an edge is the texel mirrored along that edge, across a corner the opposite corner.
void storeWithBorder(uint probe, uint x, uint y, vec3 value) {
  uint n = push.texels;
  uint size = n + 2u;
  uint base = probe * size * size;
  storeTexel(base + (y + 1u) * size + x + 1u, value);
  bool edge_x = x == 0u || x == n - 1u;
  bool edge_y = y == 0u || y == n - 1u;
  if (edge_y) storeTexel(base + (y == 0u ? 0u : n + 1u) * size + (n - x), value);
  if (edge_x) storeTexel(base + (n - y) * size + (x == 0u ? 0u : n + 1u), value);
  if (n == 1u) {
    // One texel is edge and corner on every side.
    for (uint i = 0u; i < 9u; ++i) storeTexel(base + i, value);
  } else if (edge_x && edge_y) {
    storeTexel(base + (y == 0u ? n + 1u : 0u) * size + (x == 0u ? n + 1u : 0u), value);
  }
}

void finishTexel(uint probe, uint texel, vec4 sum) {
  BlendConstants blend = push.blend;
  uint x = texel % push.texels;
  uint y = texel / push.texels;
  uint size = push.texels + 2u;
  uint stored_at = (probe * size + y + 1u) * size + x + 1u;
  vec3 mean = sum.w > 0.0 ? sum.rgb / sum.w : vec3(0.0);
  vec3 value = encodeTexel(mean);
  if (sum.w <= 0.0) {
    value = loadTexel(stored_at);  // no ray counted for this texel: it keeps what it had
  } else if (blend.hysteresis > 0.0) {
    value = mix(value, loadTexel(stored_at), blend.hysteresis);
  }
#if PL_ACCUMULATE
  uint at = probe * push.texels * push.texels + texel;
  vec3 running = mean;
  if (blend.accumulate < 1.0)
    running = sum.w > 0.0 ? average[at] + (mean - average[at]) * blend.accumulate : average[at];
  average[at] = running;
  if (blend.store_average != 0u) value = encodeTexel(running);
#endif
  if (max(value.x, max(value.y, value.z)) > kLargest) atomicAdd(counters.clamped_texels, 1u);
  storeWithBorder(probe, x, y, value);
}

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
  uint texels = push.texels * push.texels;
  uint group = i / texels;
  uint texel = i - group * texels;
  uint rays = push.blend.ray_count;
  uint last = push.blend.probe_count - 1u;
  uint first_ray[kProbes];
  vec4 sums[kProbes];
  for (uint p = 0u; p < kProbes; ++p) {
    first_ray[p] = min(group * kProbes + p, last) * rays;
    sums[p] = vec4(0.0);
  }
  for (uint r = 0u; r < rays; ++r) {
    float weight = weights[r * texels + texel];
    for (uint p = 0u; p < kProbes; ++p)
      sums[p] += contribution(radiance[first_ray[p] + r]) * weight;
  }
  for (uint p = 0u; p < kProbes; ++p)
    if (group * kProbes + p <= last)
      finishTexel(push.blend.first_probe + group * kProbes + p, texel, sums[p]);
}
