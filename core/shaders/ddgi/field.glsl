// SPDX-License-Identifier: Apache-2.0
// The field as a query reads it: constants, lattice and atlases, with the modes as compile-time
// constants, so that a switched-off part leaves no code.
#ifndef PROBELAB_DDGI_FIELD_GLSL
#define PROBELAB_DDGI_FIELD_GLSL

#include "ddgi/constants.h"
#include "ddgi/texels.glsl"

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
  return LOAD_IRRADIANCE(irradiance_atlas, uint((probe * size + y) * size + x));
}

vec2 fetchMoments(int probe, int x, int y) {
#if !PL_VISIBILITY
  return vec2(0.0);
#else
  int size = lattice.moment_texels + 2;
  return LOAD_MOMENTS(moment_atlas, uint((probe * size + y) * size + x));
#endif
}

#include "shared/query.h"

#endif
