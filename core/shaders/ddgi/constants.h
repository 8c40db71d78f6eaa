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

#ifdef __cplusplus
#define PL_ADDRESS(type) std::uint64_t
#else
struct TriangleData {
  uint vertex[3];
  uint material;
};
#define PL_ADDRESS(type) type
REFERENCE(readonly, WordArray, uint);
REFERENCE(readonly, IntArray, int);
REFERENCE(readonly, FloatArray, float);
REFERENCE(readonly, Vec3Array, vec3);
REFERENCE(readonly, Vec4Array, vec4);
REFERENCE(readonly, Vec2Array, vec2);
REFERENCE(readonly, RayArray, Ray);
REFERENCE(readonly, HitArray, Hit);
REFERENCE(readonly, EntryArray, VoxelEntry);
REFERENCE(readonly, TriangleArray, TriangleData);
REFERENCE(readonly, MaterialArray, GpuMaterial);
REFERENCE(readonly, SurfaceArray, RaySurface);
REFERENCE(restrict, SurfaceInOut, RaySurface);
REFERENCE(writeonly, RayOutput, Ray);
REFERENCE(writeonly, HitOutput, Hit);
REFERENCE(writeonly, FloatOutput, float);
REFERENCE(writeonly, Vec4Output, vec4);
REFERENCE(writeonly, WordOutput, uint);
REFERENCE(restrict, Vec3InOut, vec3);
#endif

// Where the geometry lies; 0 for what the scene's features do not need.
struct SceneAddresses {
  PL_ADDRESS(TriangleArray) triangles;
  PL_ADDRESS(Vec3Array) positions;
  PL_ADDRESS(MaterialArray) materials;
  PL_ADDRESS(Vec3Array) normals;
  PL_ADDRESS(Vec2Array) uv0;
  PL_ADDRESS(Vec2Array) uv1;
  PL_ADDRESS(WordArray) texels;
};

// Where the copy of the field lies that a query reads.
struct FieldAddresses {
  PL_ADDRESS(WordArray) irradiance;
  PL_ADDRESS(WordArray) moments;       // with visibility
  PL_ADDRESS(IntArray) probe_index;    // [lattice point]: active probe or -1
  PL_ADDRESS(IntArray) nearest_probe;  // [lattice point or voxel], with the nearest fallback
  PL_ADDRESS(Vec3Array) positions;     // [probe], where a lattice's probes are moved
  // With scattered probes.
  PL_ADDRESS(WordArray) voxel_begin;   // [piece of a voxel + 1]: first entry
  PL_ADDRESS(EntryArray) entries;
  PL_ADDRESS(Vec4Array) places;        // [probe]: position, s_i
  // Where walls divide voxels.
  PL_ADDRESS(IntArray) plane_of_voxel;
  PL_ADDRESS(Vec4Array) planes;
};

// Where the rays of a batch lie: item = probe * stride_probe + ray * stride_ray.
struct RayItems {
  PL_UINT probe_count;  // of the batch
  PL_UINT first_probe;  // of the batch: among all probes, or in the list of probes
  PL_UINT stride_probe;
  PL_UINT stride_ray;
};

// Scalars of an update that the blend stage needs. Change detection: params.h.
struct BlendConstants {
  float hysteresis;        // 0 for a first write
  float accumulate;        // 1 / k for the k-th of an average, 1 restarts it
  float gamma;
  float backface_freeze;   // share of back faces above which the irradiance stays
  float change_threshold;
  float change_drop;
  float reset_threshold;
  float brightness_threshold;
  float darkening_step;
  PL_UINT store_average;   // 1: the atlas gets the running average, 0: this update
  PL_UINT dither;          // differs from update to update
  PL_UINT texels;          // interior texels a side
};

#define PL_CHANGE_NONE 0
#define PL_CHANGE_RTXGI 1
#define PL_CHANGE_M21 2

#define PL_RAYS_BY_PROBE 0
#define PL_RAYS_BY_DIRECTION 1

#define PL_CLASSIFY_NONE 0
#define PL_CLASSIFY_INSIDE 1        // by back faces
#define PL_CLASSIFY_NEAR_SURFACE 2  // also inactive without a surface in the cells around

// What went wrong, counted on the device.
struct CounterData {
  PL_UINT non_finite_rays;    // radiance that is NaN or Inf
  PL_UINT clamped_texels;     // beyond the format's largest number
  PL_UINT answers[4];         // queries by PL_ANSWER_*; those by weights are not counted
  PL_UINT tiny_weight_sums;   // sum of weights below kTinyWeightSum
};

const float kTinyWeightSum = 1e-6f;

#ifdef __cplusplus
static_assert(sizeof(GpuMaterial) == 160 && sizeof(RaySurface) == 64 && sizeof(QueryPoint) == 36 &&
              sizeof(FieldAddresses) == 80 && sizeof(BlendConstants) == 48 && sizeof(VoxelEntry) == 12);
#endif

PL_NAMESPACE_END

#endif
