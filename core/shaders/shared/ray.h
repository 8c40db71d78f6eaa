// SPDX-License-Identifier: Apache-2.0
// Rays and hits as they lie in buffers (scalar layout) and go through every tracer.
#ifndef PROBELAB_SHARED_RAY_H
#define PROBELAB_SHARED_RAY_H

#include "shared/language.h"

PL_NAMESPACE_BEGIN

#ifdef __cplusplus
#define PL_FLOAT3 Vec3f
#define PL_UINT std::uint32_t
#else
#define PL_FLOAT3 vec3
#define PL_UINT uint
#endif

// Lengths in metres, positions relative to Scene::origin, direction of unit length. t_max <= t_min
// marks a ray that is not traced: closest reports a miss, occluded reports 0.
struct Ray {
  PL_FLOAT3 origin;
  float t_min;
  PL_FLOAT3 direction;
  float t_max;
};

// t in metres along the ray, t = t_max and primitive = kNoHit on a miss. u and v weigh the
// triangle's second and third vertex.
struct Hit {
  float t;
  PL_UINT primitive;
  float u;
  float v;
};

#ifdef __cplusplus
constexpr std::uint32_t kNoHit = 0xffffffffu;
static_assert(sizeof(Ray) == 32 && sizeof(Hit) == 16);
#else
const uint kNoHit = 0xffffffffu;
#endif

PL_NAMESPACE_END

#endif
