// SPDX-License-Identifier: Apache-2.0
// The weight of ray r for texel t, shared by all probes of an update: weights[r * texels + t].
// PL_LOBE 0: the cosine, for irradiance. 1: the cosine to the power of the distance exponent.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "shared/octahedral.h"

BUFFER(BIND_DIRECTIONS, readonly, Directions, vec3 directions[]);
BUFFER(BIND_WEIGHTS, writeonly, Weights, float weights[]);

layout(push_constant, scalar) uniform Push {
  uint item_count;
  uint texels;  // interior texels a side
  float exponent;
} push;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
  uint texels = push.texels * push.texels;
  uint ray = i / texels;
  uint texel = i - ray * texels;
  vec3 u = texelDirection(float(texel % push.texels), float(texel / push.texels),
                          float(push.texels));
  float cosine = max(0.0, dot(u, directions[ray]));
#if PL_LOBE == 0
  weights[i] = cosine;
#else
  weights[i] = cosine > 0.0 ? pow(cosine, push.exponent) : 0.0;
#endif
}
