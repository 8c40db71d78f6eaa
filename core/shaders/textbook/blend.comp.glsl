// SPDX-License-Identifier: Apache-2.0
// Rays -> texels as [RTXGI] 1.3.7 publishes it: a workgroup a probe, an invocation a texel with the
// border, which loops over all rays of its probe. PL_BLEND 0: irradiance; 1: mean and mean square of
// the distance, whose weight is a power of the cosine, taken for every ray and texel.
// PL_SHARED_MEMORY 1 stages the probe's rays in shared memory, as the SDK does by default.
//
// Differs from the SDK in what is stored: mean^(1/gamma) and full moments, where it stores half of
// each, so that the texels compare with Probelab's; ray directions are read, not computed.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/octahedral.h"
#include "textbook/constants.h"

layout(local_size_x = PL_TEXELS, local_size_y = PL_TEXELS) in;

layout(set = 0, binding = 0) readonly buffer Directions { vec4 directions[]; };
// Radiance and the signed distance, negative on back faces: [probe of the dispatch][ray].
layout(set = 0, binding = 1) readonly buffer Rays { vec4 rays[]; };
// A slice holds a y-plane of probes, x along the width and z along the height.
layout(set = 0, binding = 2, PL_FORMAT) uniform coherent image2DArray atlas;
layout(push_constant, scalar) uniform Push { TextbookBlend push; };

const int kInterior = PL_TEXELS - 2;

#if PL_BLEND == 0
#define RAY_DATA vec4
RAY_DATA loadRay(uint ray) { return rays[gl_WorkGroupID.x * PL_RAYS + ray]; }
#else
#define RAY_DATA float
RAY_DATA loadRay(uint ray) {
  return min(abs(rays[gl_WorkGroupID.x * PL_RAYS + ray].w), push.largest_distance);
}
#endif

#if PL_SHARED_MEMORY
shared vec3 shared_direction[PL_RAYS];
shared RAY_DATA shared_ray[PL_RAYS];
void stageRays() {
  for (uint ray = gl_LocalInvocationIndex; ray < PL_RAYS; ray += PL_TEXELS * PL_TEXELS) {
    shared_direction[ray] = directions[ray].xyz;
    shared_ray[ray] = loadRay(ray);
  }
  memoryBarrierShared();
  barrier();
}
#define DIRECTION(ray) shared_direction[ray]
#define RAY(ray) shared_ray[ray]
#else
void stageRays() {}
#define DIRECTION(ray) directions[ray].xyz
#define RAY(ray) loadRay(ray)
#endif

#if PL_BLEND == 0
float largestComponent(vec3 v) { return max(v.x, max(v.y, v.z)); }

// The step from the stored towards the new value, by the SDK's rules for changing light.
vec3 blendTexel(vec3 stored, vec3 value, float hysteresis) {
  if (largestComponent(stored - value) > push.irradiance_threshold)
    hysteresis = max(0.0, hysteresis - 0.75);
  vec3 delta = value - stored;
  if (dot(delta, vec3(0.2126, 0.7152, 0.0722)) > push.brightness_threshold) delta *= 0.25;
  vec3 step_ = (1.0 - hysteresis) * delta;
  if (largestComponent(value) < largestComponent(stored))
    step_ = min(max(vec3(push.smallest_step), abs(step_)), abs(delta)) * sign(step_);
  return stored + step_;
}

void updateTexel(ivec3 texel, vec3 texel_direction) {
  vec4 sum = vec4(0.0);
  uint backfaces = 0u;
  for (uint ray = 0u; ray < PL_RAYS; ++ray) {
    vec4 data = RAY(ray);
    if (data.w < 0.0) {
      if (++backfaces >= push.backface_limit) return;  // the probe lies in a wall: keep its texels
      continue;
    }
    float weight = max(0.0, dot(texel_direction, DIRECTION(ray)));
    sum += vec4(data.rgb * weight, weight);
  }
  vec3 value = pow(sum.rgb / max(sum.w, 1e-9 * float(PL_RAYS)), vec3(push.encode_exponent));
  vec3 stored = imageLoad(atlas, texel).rgb;
  float hysteresis = dot(stored, stored) == 0.0 ? 0.0 : push.hysteresis;
  imageStore(atlas, texel, vec4(blendTexel(stored, value, hysteresis), 1.0));
}
#else
void updateTexel(ivec3 texel, vec3 texel_direction) {
  vec3 sum = vec3(0.0);
  for (uint ray = 0u; ray < PL_RAYS; ++ray) {
    float weight =
        pow(max(0.0, dot(texel_direction, DIRECTION(ray))), push.distance_exponent);
    float distance_m = RAY(ray);
    sum += vec3(distance_m * weight, distance_m * distance_m * weight, weight);
  }
  vec2 value = sum.xy / max(sum.z, 1e-9 * float(PL_RAYS));
  vec2 stored = imageLoad(atlas, texel).rg;
  float hysteresis = dot(stored, stored) == 0.0 ? 0.0 : push.hysteresis;
  imageStore(atlas, texel, vec4(mix(value, stored, hysteresis), 0.0, 1.0));
}
#endif

// Where a border texel is copied from, in the probe's own texels: across an edge the map goes on
// mirrored, across a corner at the opposite one.
ivec2 borderSource(ivec2 texel) {
  const int last = PL_TEXELS - 1;
  bool edge_x = texel.x == 0 || texel.x == last;
  bool edge_y = texel.y == 0 || texel.y == last;
  if (edge_x && edge_y)
    return ivec2(texel.x > 0 ? 1 : kInterior, texel.y > 0 ? 1 : kInterior);
  if (edge_y) return ivec2(last - texel.x, texel.y > 0 ? kInterior : 1);
  return ivec2(texel.x > 0 ? kInterior : 1, last - texel.y);
}

void main() {
  ivec2 texel = ivec2(gl_LocalInvocationID.xy);
  uint probe = push.first_probe + gl_WorkGroupID.x;
  ivec3 origin = ivec3(PL_TEXELS * (probe % push.count_x),
                       PL_TEXELS * (probe / (push.count_x * push.count_y)),
                       probe / push.count_x % push.count_y);
  bool border = any(equal(texel, ivec2(0))) || any(equal(texel, ivec2(PL_TEXELS - 1)));
  stageRays();
  if (!border) {
    ivec2 interior = texel - 1;
    updateTexel(origin + ivec3(texel, 0),
                texelDirection(float(interior.x), float(interior.y), float(kInterior)));
  }
  memoryBarrierImage();
  barrier();
  if (border)
    imageStore(atlas, origin + ivec3(texel, 0),
               imageLoad(atlas, origin + ivec3(borderSource(texel), 0)));
}
