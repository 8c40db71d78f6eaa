// SPDX-License-Identifier: Apache-2.0
// Point, spot and directional lights as both renderers evaluate them (KHR_lights_punctual), on
// plain float. Included by core/trace and by the shade stage.
//
// A shader that knows which kinds the scene has defines PL_LIGHT_DIRECTIONAL, PL_LIGHT_POINT and
// PL_LIGHT_SPOT as 0 or 1 before including; a kind that is 0 leaves no code behind.
#ifndef PROBELAB_SHARED_LIGHT_H
#define PROBELAB_SHARED_LIGHT_H

#include "shared/ray.h"

#ifndef PL_LIGHT_DIRECTIONAL
#define PL_LIGHT_DIRECTIONAL 1
#endif
#ifndef PL_LIGHT_POINT
#define PL_LIGHT_POINT 1
#endif
#ifndef PL_LIGHT_SPOT
#define PL_LIGHT_SPOT 1
#endif

PL_NAMESPACE_BEGIN

// The values of scene's LightType.
const PL_UINT kLightDirectional = 0u;
const PL_UINT kLightPoint = 1u;
const PL_UINT kLightSpot = 2u;

// End of a ray that only the sky stops: finite, and below what Embree accepts as a coordinate.
const float kFarDistance = 1e18f;

// A shadow ray ends this share of its length before the light, so that a light mounted on a surface
// is not hidden by it; 84 units in the last place, well above the rounding of a hit's distance.
const float kLightGap = 1e-5f;

// Scalar layout. `range` in metres, 0: unlimited. `direction`: the way the light travels, unit.
struct LightData {
  PL_FLOAT3 intensity;  // lux (directional) or candela, colour included
  PL_UINT type;
  PL_FLOAT3 position;
  float range;
  PL_FLOAT3 direction;
  float cos_inner;
  float cos_outer;
};

// What a light does at a point. `irradiance` falls on a plane perpendicular to the light, without
// shadow; zero where the light does not reach. `direction` is of unit length, towards the light.
struct LightSample {
  PL_FLOAT3 direction;
  float t_max;  // end of the shadow ray that starts at the point
  PL_FLOAT3 irradiance;
};

// Spot smoothing and range window as the KHR_lights_punctual text recommends them.
PL_INLINE float spotFactor(float cos_angle, float cos_inner, float cos_outer) {
  const float s = clamp((cos_angle - cos_outer) / max(0.001f, cos_inner - cos_outer), 0.0f, 1.0f);
  return s * s;
}
PL_INLINE float rangeWindow(float distance_m, float range) {
  if (!(range > 0.0f)) return 1.0f;
  const float q = distance_m / range;
  return clamp(1.0f - q * q * q * q, 0.0f, 1.0f);
}

// `x`: where the shadow ray will start (the offset origin), so that t_max belongs to it. A point on
// the light itself gets nothing: the direction to it is undefined, and that set has no measure.
PL_INLINE LightSample sampleLight(PL_CONST_IN(LightData) light, PL_FLOAT3 x) {
  LightSample result;
  result.direction = PL_FLOAT3(0.0f, 1.0f, 0.0f);
  result.t_max = 0.0f;
  result.irradiance = PL_FLOAT3(0.0f);
#if PL_LIGHT_DIRECTIONAL
  if (light.type == kLightDirectional) {
    result.direction = -light.direction;
    result.t_max = kFarDistance;
    result.irradiance = light.intensity;
  }
#endif
#if PL_LIGHT_POINT || PL_LIGHT_SPOT
  if (light.type != kLightDirectional) {
    const PL_FLOAT3 to_light = light.position - x;
    const float distance_m = length(to_light);
    if (distance_m > 1e-15f) {
      result.direction = to_light * (1.0f / distance_m);
      result.t_max = distance_m * (1.0f - kLightGap);
      float factor = rangeWindow(distance_m, light.range);
#if PL_LIGHT_SPOT
      if (light.type == kLightSpot)
        factor *=
            spotFactor(-dot(result.direction, light.direction), light.cos_inner, light.cos_outer);
#endif
      result.irradiance = light.intensity * (factor / (distance_m * distance_m));
    }
  }
#endif
  return result;
}

#ifdef __cplusplus
static_assert(sizeof(LightData) == 52 && sizeof(LightSample) == 28);
#endif

PL_NAMESPACE_END

#endif
