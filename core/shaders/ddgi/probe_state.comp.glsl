// SPDX-License-Identifier: Apache-2.0
// What a probe's fixed rays say of its place ([RTXGI], made free of world units): PL_STATE 0 moves
// it, 1 decides whether it is active. One invocation a probe; ray r of probe p is item
// p * stride_probe + r * stride_ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"

BUFFER(BIND_DIRECTIONS, readonly, Directions, vec3 directions[]);
#if PL_STATE == 0
BUFFER(BIND_HOMES, readonly, Homes, vec3 homes[]);          // [probe], where the layout put it
BUFFER(BIND_PROBES, restrict, Probes, vec3 positions[]);
#else
BUFFER(BIND_ACTIVE, writeonly, Active, uint active_probes[]);  // [probe]
#endif

#if PL_LOCAL_LENGTHS
BUFFER(BIND_LENGTHS, readonly, Lengths, float bias_lengths[]);  // [probe], s_i in metres
#endif

layout(push_constant, scalar) uniform Push {
  RayItems items;
  uint ray_count;
  uint near_surface;         // 1: a probe without a surface in the cells around it is inactive
  float backface_threshold;  // share of the rays
  float front_distance;      // kept from front faces, x s_i
  vec3 spacing;              // metres, of a lattice
  float limit;               // x spacing, farthest from home
  float bias_length;         // s_i in metres, of a lattice
  SurfaceArray surfaces;
} push;

// The nearest back face, the nearest and the farthest front face; distances are positive.
struct FixedHits {
  uint back_count;
  float back;
  vec3 to_back;
  float near;
  vec3 to_near;
  float far;
  vec3 to_far;
  bool surface_around;  // a front face within one spacing along every axis
};

// The lengths of a probe, metres: s_i, and the spacing along the axes.
struct LocalLengths {
  float bias;
  vec3 spacing;
};

LocalLengths lengthsOf(uint probe) {
#if PL_LOCAL_LENGTHS
  float bias = bias_lengths[probe];
  return LocalLengths(bias, vec3(bias));
#else
  return LocalLengths(push.bias_length, push.spacing);
#endif
}

// `p`: the probe's number in the batch.
FixedHits gatherHits(uint p, vec3 spacing) {
  FixedHits hits = FixedHits(0u, kMissDistance, vec3(0.0), kMissDistance, vec3(0.0), 0.0, vec3(0.0),
                             false);
  for (uint r = 0u; r < push.ray_count; ++r) {
    uint item = p * push.items.stride_probe + r * push.items.stride_ray;
    float t = push.surfaces.at[item].distance;
    vec3 d = directions[r];
    if (t < 0.0) {
      hits.back_count += 1u;
      if (-t < hits.back) hits.back = -t, hits.to_back = d;
      continue;
    }
    if (t < hits.near) hits.near = t, hits.to_near = d;
    if (t > hits.far) hits.far = t, hits.to_far = d;
    vec3 reach = abs(d) * t;
    if (all(lessThanEqual(reach, spacing))) hits.surface_around = true;
  }
  return hits;
}

#if PL_STATE == 0
// `kept`: metres, from front faces.
vec3 relocated(FixedHits hits, vec3 offset, float kept) {
  if (float(hits.back_count) > push.backface_threshold * float(push.ray_count))
    return offset + hits.to_back * (hits.back + 0.5 * kept);
  if (hits.near < kept) {
    // Away from the nearest face, as far as it is too near, where the farthest one is on that side.
    if (dot(hits.to_near, hits.to_far) > 0.0) return offset;
    return offset + hits.to_far * min(kept - hits.near, 0.5 * hits.far);
  }
  float away = length(offset);
  if (away == 0.0) return offset;
  return offset * (1.0 - min(hits.near - kept, away) / away);
}
#endif

void main() {
  uint p = gl_GlobalInvocationID.x;
  if (p >= push.items.probe_count) return;
  uint probe = push.items.first_probe + p;
  LocalLengths lengths = lengthsOf(probe);
  FixedHits hits = gatherHits(p, lengths.spacing);
#if PL_STATE == 0
  vec3 offset = relocated(hits, positions[probe] - homes[probe],
                          push.front_distance * lengths.bias);
  vec3 share = offset / lengths.spacing;
  if (dot(share, share) < push.limit * push.limit) positions[probe] = homes[probe] + offset;
#else
  bool inside = float(hits.back_count) > push.backface_threshold * float(push.ray_count);
  active_probes[probe] = inside || (push.near_surface != 0u && !hits.surface_around) ? 0u : 1u;
#endif
}
