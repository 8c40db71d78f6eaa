// SPDX-License-Identifier: Apache-2.0
// Outgoing radiance of what each ray found: what `shade` and `light` left, plus the bounce,
// albedo / pi times the irradiance that the previous field answers there.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/field.glsl"

BUFFER(BIND_SURFACES, readonly, Surfaces, RaySurface surfaces[]);
BUFFER(BIND_RAYS, readonly, Rays, Ray rays[]);
BUFFER(BIND_RADIANCE, writeonly, Radiance, vec4 radiance[]);  // rgb, signed distance in metres
#if PL_STORE_DISTANCES
BUFFER(BIND_DISTANCES, writeonly, Distances, vec2 distances[]);  // r and r^2 in units of r_i
#endif
BUFFER(BIND_COUNTERS, restrict, CounterBuffer, Counters counters);
#if PL_STORE_IRRADIANCE
BUFFER(BIND_HIT_IRRADIANCE, writeonly, HitIrradiance, vec4 hit_irradiance[]);
#endif

layout(push_constant, scalar) uniform Push { uint item_count; } push;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
  RaySurface surface = surfaces[i];
  vec3 outgoing = surface.radiance;
  vec3 irradiance = vec3(0.0);
  if (surface.hit != 0u && max(surface.albedo.x, max(surface.albedo.y, surface.albedo.z)) > 0.0) {
    QueryResult result = queryLattice(query_params, kModes, lattice, surface.origin,
                                      surface.normal, rays[i].direction);
    if (result.fallback != 0) atomicAdd(counters.fallback_queries, 1u);
    irradiance = result.irradiance;
    outgoing += surface.albedo * irradiance * (1.0 / 3.14159265358979);
  }
  if (any(isnan(outgoing)) || any(isinf(outgoing))) atomicAdd(counters.non_finite_rays, 1u);
  radiance[i] = vec4(outgoing, surface.distance);
#if PL_STORE_DISTANCES
  float distance_m =
      surface.distance < 0.0 ? -surface.distance * distance_rule.backface_shortening
                             : surface.distance;
  float r = min(distance_m * distance_rule.scale, distance_rule.clamp_at);
  distances[i] = vec2(r, r * r);
#endif
#if PL_STORE_IRRADIANCE
  hit_irradiance[i] = vec4(irradiance, float(surface.hit));
#endif
}
