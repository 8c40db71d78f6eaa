// SPDX-License-Identifier: Apache-2.0
// Outgoing radiance of what each ray found: what `shade` and `light` left, plus the bounce,
// albedo / pi times the irradiance that the previous field answers there.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"

layout(push_constant, scalar) uniform Push {
  uint item_count;
  float radiance_clamp;
  FieldAddresses field;
  SurfaceArray surfaces;
  RayArray rays;
  Vec4Output radiance;        // rgb, signed distance in metres
  FloatOutput distances;      // in units of r_i, clamped
  Vec4Output hit_irradiance;
} push;

#include "ddgi/field.glsl"

BUFFER(BIND_COUNTERS, restrict, CounterBuffer, CounterData counters);

void main() {
#if PL_FEEDBACK
  QueryParams params = query_params;
  LatticeShape shape = specialisedLattice();
#endif
#if PL_STORE_DISTANCES
  DistanceRule rule = distance_rule;
#endif
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
  RaySurface surface = push.surfaces.at[i];
  vec3 outgoing = surface.radiance;
  vec3 irradiance = vec3(0.0);
#if PL_FEEDBACK
  if (surface.hit != 0u && max(surface.albedo.x, max(surface.albedo.y, surface.albedo.z)) > 0.0) {
    QueryResult result = queryField(params, shape, surface.origin, surface.normal,
                                    push.rays.at[i].direction);
    COUNT_ANSWER(counters, result.answer);
    irradiance = result.irradiance;
    outgoing += surface.albedo * irradiance * (1.0 / 3.14159265358979);
  }
#endif
  if (any(isnan(outgoing)) || any(isinf(outgoing))) atomicAdd(counters.non_finite_rays, 1u);
#if PL_RADIANCE_CLAMP
  outgoing = min(outgoing, vec3(push.radiance_clamp));
#endif
  push.radiance.at[i] = vec4(outgoing, surface.distance);
#if PL_STORE_DISTANCES
  float distance_m = surface.distance < 0.0 ? -surface.distance * rule.backface_shortening
                                            : surface.distance;
  push.distances.at[i] = min(distance_m * rule.scale, rule.clamp_at);
#endif
#if PL_STORE_IRRADIANCE
  push.hit_irradiance.at[i] = vec4(irradiance, float(surface.hit));
#endif
}
