// SPDX-License-Identifier: Apache-2.0
// The field as a query reads it: constants, lattice and atlases, with the modes as compile-time
// constants, so that a switched-off part leaves no code. Before it, the stage declares a block
// `push` with a member `FieldAddresses field`.
#ifndef PROBELAB_DDGI_FIELD_GLSL
#define PROBELAB_DDGI_FIELD_GLSL

#include "ddgi/texels.glsl"

BUFFER(BIND_FIELD, readonly, FieldBuffer, 
       LatticeShape lattice; QueryParams query_params; DistanceRule distance_rule);

const QueryModes kModes = QueryModes(PL_FACING, PL_TRILINEAR, PL_VISIBILITY, PL_CRUSH, PL_AVERAGE,
                                     PL_FALLBACK, PL_MOVED, PL_OFFSET_WEIGHTS);

int fetchProbe(int lattice_index) { return push.field.probe_index.at[lattice_index]; }
int fetchNearest(int lattice_index) { return push.field.nearest_probe.at[lattice_index]; }
vec3 fetchPosition(int probe) { return push.field.positions.at[probe]; }

vec3 fetchIrradiance(int probe, int texel) {
  int side = lattice.irradiance_texels + 2 * lattice.border;
  return loadIrradiance(push.field.irradiance, uint(probe * side * side + texel));
}

vec2 fetchMoments(int probe, int texel) {
  int side = lattice.moment_texels + 2 * lattice.border;
  return loadMoments(push.field.moments, uint(probe * side * side + texel));
}

#include "shared/query.h"

// Counts how a query was answered.
#define COUNT_ANSWER(counters, answer)                                                \
  if ((answer) != PL_ANSWER_WEIGHED) {                                                \
    atomicAdd((counters).fallback_queries, 1u);                                       \
    if ((answer) == PL_ANSWER_UNOCCLUDED) atomicAdd((counters).unoccluded_answers, 1u); \
    else if ((answer) == PL_ANSWER_NEAREST) atomicAdd((counters).nearest_answers, 1u);  \
    else atomicAdd((counters).empty_answers, 1u);                                     \
  }

#endif
