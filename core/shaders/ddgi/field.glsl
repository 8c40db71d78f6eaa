// SPDX-License-Identifier: Apache-2.0
// The field as a query reads it: constants, lattice and atlases, with the modes as compile-time
// constants, so that a switched-off part leaves no code.
#ifndef PROBELAB_DDGI_FIELD_GLSL
#define PROBELAB_DDGI_FIELD_GLSL

#include "ddgi/constants.h"
#include "shared/atlas_format.h"

BUFFER(BIND_FIELD, readonly, FieldBuffer, 
       LatticeShape lattice; QueryParams query_params; DistanceRule distance_rule);
BUFFER(BIND_PROBE_INDEX, readonly, ProbeIndex, int probe_index[]);
BUFFER(BIND_IRRADIANCE, readonly, IrradianceAtlas, uint irradiance_atlas[]);
#if PL_VISIBILITY
BUFFER(BIND_MOMENTS, readonly, MomentAtlas, uint moment_atlas[]);
#endif

const QueryModes kModes =
    QueryModes(PL_FACING, PL_TRILINEAR, PL_VISIBILITY, PL_CRUSH, PL_AVERAGE, PL_FALLBACK);

int fetchProbe(int lattice_index) { return probe_index[lattice_index]; }

vec3 fetchIrradiance(int probe, int x, int y) {
  int size = lattice.irradiance_texels + 2;
  uint texel = uint((probe * size + y) * size + x);
#if PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA32F
  return vec3(uintBitsToFloat(irradiance_atlas[texel * 4u]),
              uintBitsToFloat(irradiance_atlas[texel * 4u + 1u]),
              uintBitsToFloat(irradiance_atlas[texel * 4u + 2u]));
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA16F
  uint rg = irradiance_atlas[texel * 2u];
  return vec3(unpackHalfFloat(rg & 0xffffu), unpackHalfFloat(rg >> 16u),
              unpackHalfFloat(irradiance_atlas[texel * 2u + 1u] & 0xffffu));
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_R11G11B10F
  return unpackR11G11B10(irradiance_atlas[texel]);
#else
  return unpackRgb10A2(irradiance_atlas[texel]);
#endif
}

vec2 fetchMoments(int probe, int x, int y) {
#if !PL_VISIBILITY
  return vec2(0.0);
#else
  int size = lattice.moment_texels + 2;
  uint texel = uint((probe * size + y) * size + x);
#if PL_MOMENT_FORMAT == PL_FORMAT_RG32F
  return vec2(uintBitsToFloat(moment_atlas[texel * 2u]),
              uintBitsToFloat(moment_atlas[texel * 2u + 1u]));
#else
  uint pair = moment_atlas[texel];
  return vec2(unpackHalfFloat(pair & 0xffffu), unpackHalfFloat(pair >> 16u));
#endif
#endif
}

#include "shared/query.h"

#endif
