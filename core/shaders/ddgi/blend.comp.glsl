// SPDX-License-Identifier: Apache-2.0
// Rays -> texels ([M19], [RTXGI]). A workgroup takes kProbes probes, an invocation a texel of all of
// them: the weights come from one table, since all probes share their directions, and what a ray
// brings is read once for the whole workgroup. PL_BLEND 0: irradiance, as mean radiance under the
// cosine, encoded; 1: mean and mean square of the radial distance in units of r_i. Each texel also
// writes the border texels that repeat it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"
#include "ddgi/texels.glsl"

#if PL_BLEND == 0
BUFFER(BIND_RADIANCE, readonly, Radiance, vec4 radiance[]);
#else
BUFFER(BIND_DISTANCES, readonly, Distances, vec2 distances[]);  // r and r^2 in units of r_i
#endif
BUFFER(BIND_WEIGHTS, readonly, Weights, float weights[]);
BUFFER(BIND_PREVIOUS, readonly, Previous, uint previous[]);
BUFFER(BIND_ATLAS, writeonly, Atlas, uint atlas[]);
BUFFER(BIND_COUNTERS, restrict, CounterBuffer, Counters counters);
#if PL_ACCUMULATE
BUFFER(BIND_AVERAGE, restrict, Average, vec3 average[]);  // linear, interior texels
#endif

layout(push_constant, scalar) uniform Push {
  uint texels;  // interior texels a side
  BlendConstants blend;
} push;

const uint kProbes = 8u;

#if PL_BLEND == 0
vec3 loadTexel(uint texel) { return LOAD_IRRADIANCE(previous, texel); }
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
// What a ray adds, with its share of the weight in w: radiance, or nothing where back faces are left
// out.
vec4 contribution(uint ray) {
  vec4 value = radiance[ray];
  return push.blend.backface_skip != 0u && value.w < 0.0 ? vec4(0.0) : vec4(value.rgb, 1.0);
}
vec3 encodeTexel(vec3 mean) {
  if (push.blend.encode_exponent == 1.0) return mean;
  return pow(mean, vec3(push.blend.encode_exponent));
}
#else
vec3 loadTexel(uint texel) { return vec3(LOAD_MOMENTS(previous, texel), 0.0); }
void storeTexel(uint texel, vec3 value) {
#if PL_MOMENT_FORMAT == PL_FORMAT_RG32F
  atlas[texel * 2u] = floatBitsToUint(value.x);
  atlas[texel * 2u + 1u] = floatBitsToUint(value.y);
#else
  atlas[texel] = packHalfPair(value.x, value.y);
#endif
}
const float kLargest = PL_MOMENT_FORMAT == PL_FORMAT_RG32F ? 3.4e38 : 65504.0;
vec4 contribution(uint ray) { return vec4(distances[ray], 0.0, 1.0); }
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
  uint texels = push.texels * push.texels;
  uint rays = push.blend.ray_count;
  uint last = push.blend.probe_count - 1u;
  uint first_probe = gl_WorkGroupID.x * kProbes;
  for (uint texel = gl_LocalInvocationID.x; texel < texels; texel += kGroupSize) {
    vec4 sums[kProbes];
    for (uint p = 0u; p < kProbes; ++p) sums[p] = vec4(0.0);
    for (uint r = 0u; r < rays; ++r) {
      float weight = weights[r * texels + texel];
      for (uint p = 0u; p < kProbes; ++p)
        sums[p] += contribution(min(first_probe + p, last) * rays + r) * weight;
    }
    for (uint p = 0u; p < kProbes; ++p)
      if (first_probe + p <= last)
        finishTexel(push.blend.first_probe + first_probe + p, texel, sums[p]);
  }
}
