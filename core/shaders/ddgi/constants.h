// SPDX-License-Identifier: Apache-2.0
// Buffers that C++ fills and the stages read, in scalar layout; compiled by both.
#ifndef PROBELAB_DDGI_CONSTANTS_H
#define PROBELAB_DDGI_CONSTANTS_H

#include "shared/query_params.h"
#include "shared/sky.h"
#include "shared/texture_use.h"

PL_NAMESPACE_BEGIN

// One material; textures with width 0 are absent.
struct GpuMaterial {
  PL_FLOAT3 base_color;
  float metallic;
  PL_FLOAT3 emission;
  float base_alpha;
  TextureUseData base_color_texture;
  TextureUseData metallic_texture;
  TextureUseData emission_texture;
  float alpha_cutoff;
  PL_UINT flags;  // kMaterialDoubleSided | kMaterialAlphaMask
};

const PL_UINT kMaterialDoubleSided = 1u;
const PL_UINT kMaterialAlphaMask = 2u;

// What a ray found. `radiance` starts as emission (or the sky), direct light is added to it.
// The geometric normal is octahedral, in ng_x and ng_y.
struct RaySurface {
  PL_FLOAT3 origin;   // on the front side, safe to start a ray from
  float distance;     // metres; negative on a back face, kMissDistance on a miss
  PL_FLOAT3 normal;   // shading normal, on the front side
  float ng_x;
  PL_FLOAT3 albedo;   // 0: reflects nothing (a miss, a back face)
  float ng_y;
  PL_FLOAT3 radiance;
  PL_UINT hit;        // 1: `albedo` may reflect
};

const float kMissDistance = 1e27f;  // [RTXGI]

// A point where the field is asked for.
struct QueryPoint {
  PL_FLOAT3 position;
  PL_FLOAT3 normal;
  PL_FLOAT3 view;
};

// How the distance along a ray becomes the one that is averaged.
struct DistanceRule {
  float scale;                // 1 / r_i
  float clamp_at;             // x r_i
  float backface_shortening;  // factor on a back face's distance
};

// Scalars of an update that the blend stage needs.
struct BlendConstants {
  PL_UINT probe_count;     // of the batch
  PL_UINT first_probe;     // of the batch, in the atlas
  PL_UINT ray_count;       // rays a probe
  float hysteresis;        // 0 for a first write
  float accumulate;        // 1 / k for the k-th of an average, 0: no average
  float encode_exponent;   // 1 / gamma
  PL_UINT backface_skip;   // 1: rays that hit a back face are left out of the irradiance
  PL_UINT store_average;   // 1: the atlas gets the running average, 0: this update
};

// What went wrong, counted on the device.
struct Counters {
  PL_UINT non_finite_rays;    // radiance that is NaN or Inf
  PL_UINT clamped_texels;     // beyond the format's largest number
  PL_UINT fallback_queries;   // no probe answered
  PL_UINT tiny_weight_sums;   // sum of weights below kTinyWeightSum
};

const float kTinyWeightSum = 1e-6f;

#ifdef __cplusplus
static_assert(sizeof(GpuMaterial) == 160 && sizeof(RaySurface) == 64 && sizeof(QueryPoint) == 36 &&
              sizeof(BlendConstants) == 32);
#endif

PL_NAMESPACE_END

#endif
