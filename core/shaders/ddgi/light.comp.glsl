// SPDX-License-Identifier: Apache-2.0
// Direct light, one light at a time. PL_LIGHT_PASS 0 writes the shadow rays of the light, 1 adds what
// arrives along those that were not occluded.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"
#include "shared/octahedral.h"
#include "shared/light.h"

BUFFER(BIND_LIGHTS, readonly, Lights, LightData lights[]);
layout(push_constant, scalar) uniform Push {
  uint item_count;
  uint light;
  SurfaceInOut surfaces;
  RayOutput shadow_rays;
  WordArray occluded;
} push;

// Irradiance on the surface without shadow; 0 where the light is behind either normal.
vec3 unshadowed(RaySurface surface, LightSample light) {
  float cosine = dot(surface.normal, light.direction);
  vec3 geometric = octDecode(vec2(surface.ng_x, surface.ng_y));
  if (surface.hit == 0u || cosine <= 0.0 || dot(geometric, light.direction) <= 0.0)
    return vec3(0.0);
  return light.irradiance * cosine;
}

void main() {
  LightData light_data = lights[push.light];
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
  RaySurface surface = push.surfaces.at[i];
  LightSample light = sampleLight(light_data, surface.origin);
  vec3 irradiance = unshadowed(surface, light);
#if PL_LIGHT_PASS == 0
  bool lit = max(irradiance.x, max(irradiance.y, irradiance.z)) > 0.0;
  push.shadow_rays.at[i] = Ray(surface.origin, 0.0, light.direction, lit ? light.t_max : 0.0);
#else
  if (push.occluded.at[i] == 0u)
    push.surfaces.at[i].radiance =
        surface.radiance + surface.albedo * irradiance * (1.0 / 3.14159265358979);
#endif
}
