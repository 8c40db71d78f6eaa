// SPDX-License-Identifier: Apache-2.0
// Radiance of the sky. Equirectangular images: u = 0.5 + atan2(d.x, -d.z) / (2 pi),
// v = acos(d.y) / pi; texels are constant over their area, so that sampling densities are exact.
#ifndef PROBELAB_SHARED_SKY_H
#define PROBELAB_SHARED_SKY_H

#include "shared/ray.h"

PL_NAMESPACE_BEGIN

// Everything is already multiplied by the state's scale.
struct SkyData {
  PL_FLOAT3 radiance;
  int width;  // 0: no image
  PL_FLOAT3 linear;
  int height;
};

// radiance (1 + linear . d)
PL_INLINE PL_FLOAT3 linearSky(SkyData sky, PL_FLOAT3 d) {
  return sky.radiance * (1.0f + dot(sky.linear, d));
}

// Index of the image's texel that direction d sees, row-major.
PL_INLINE int skyTexel(SkyData sky, PL_FLOAT3 d) {
  const float pi = 3.14159265358979f;
#ifdef __cplusplus
  float u = 0.5f + std::atan2(d.x, -d.z) / (2.0f * pi);
  float v = std::acos(clamp(d.y, -1.0f, 1.0f)) / pi;
#else
  float u = 0.5f + atan(d.x, -d.z) / (2.0f * pi);
  float v = acos(clamp(d.y, -1.0f, 1.0f)) / pi;
#endif
  int x = min(int(u * float(sky.width)), sky.width - 1);
  int y = min(int(v * float(sky.height)), sky.height - 1);
  return y * sky.width + x;
}

PL_NAMESPACE_END

#endif
