// SPDX-License-Identifier: Apache-2.0
// The probes' rays: the same directions for all probes of an update. Ray r of the batch's probe p is
// item p * ray_count + r.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"

BUFFER(BIND_RAYS, writeonly, Rays, Ray rays[]);
BUFFER(BIND_DIRECTIONS, readonly, Directions, vec3 directions[]);
BUFFER(BIND_PROBES, readonly, Probes, vec3 probe_positions[]);

layout(push_constant, scalar) uniform Push {
  uint item_count;
  uint first_probe;
  uint ray_count;
} push;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
  uint probe = i / push.ray_count;
  rays[i].origin = probe_positions[push.first_probe + probe];
  rays[i].t_min = 0.0;
  rays[i].direction = directions[i - probe * push.ray_count];
  rays[i].t_max = kMissDistance;
}
