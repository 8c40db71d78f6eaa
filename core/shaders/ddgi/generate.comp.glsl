// SPDX-License-Identifier: Apache-2.0
// The probes' rays: the same directions for all probes of an update.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"

BUFFER(BIND_DIRECTIONS, readonly, Directions, vec3 directions[]);
BUFFER(BIND_PROBES, readonly, Probes, vec3 probe_positions[]);
#if PL_PROBE_LIST
BUFFER(BIND_PROBE_LIST, readonly, ProbeList, uint probe_list[]);
#endif

layout(push_constant, scalar) uniform Push {
  uint item_count;
  RayItems items;
  uint unused;
  RayOutput rays;
} push;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
  uint probe, ray;
  if (push.items.stride_probe == 1u && push.items.stride_ray == push.items.probe_count) {
    ray = i / push.items.probe_count;
    probe = i - ray * push.items.probe_count;
  } else {
    probe = i / push.items.stride_probe;
    ray = i - probe * push.items.stride_probe;
  }
  probe += push.items.first_probe;
#if PL_PROBE_LIST
  probe = probe_list[probe];
#endif
  push.rays.at[i] = Ray(probe_positions[probe], 0.0, directions[ray], kMissDistance);
}
