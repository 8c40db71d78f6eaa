// SPDX-License-Identifier: Apache-2.0
// The field as a query reads it: constants, lattice and atlases, with the modes as compile-time
// constants, so that a switched-off part leaves no code. Before it, the stage declares a block
// `push` with a member `FieldAddresses field`.
#ifndef PROBELAB_DDGI_FIELD_GLSL
#define PROBELAB_DDGI_FIELD_GLSL

#include "ddgi/texels.glsl"

UNIFORM(BIND_FIELD, FieldBuffer,
        LatticeShape lattice; QueryParams query_params; DistanceRule distance_rule);

// The lattice with what the stage was specialised to as constants.
LatticeShape specialisedLattice() {
  LatticeShape shape = lattice;
  shape.irradiance_texels = PL_IRRADIANCE_TEXELS;
  shape.moment_texels = PL_MOMENT_TEXELS;
  shape.border = PL_BORDER;
  return shape;
}

const QueryModes kModes = QueryModes(PL_FACING, PL_TRILINEAR, PL_VISIBILITY, PL_CRUSH, PL_AVERAGE,
                                     PL_FALLBACK, PL_MOVED, PL_OFFSET_WEIGHTS, PL_WALLS, PL_PARALLAX);

#if PL_INTERPOLANT == PL_INTERPOLANT_SCATTERED
uint fetchVoxelBegin(int voxel) { return push.field.voxel_begin.at[voxel]; }
VoxelEntry fetchEntry(uint index) { return push.field.entries.at[index]; }
vec4 fetchPlace(int probe) { return push.field.places.at[probe]; }
#if PL_WALLS
int fetchPlaneOfVoxel(int voxel) { return push.field.plane_of_voxel.at[voxel]; }
vec4 fetchPlane(int plane) { return push.field.planes.at[plane]; }
#else
int fetchPlaneOfVoxel(int voxel) { return -1; }
vec4 fetchPlane(int plane) { return vec4(0); }
#endif
#else
#if PL_FULL_LATTICE
int fetchProbe(int lattice_index) { return lattice_index; }
#else
int fetchProbe(int lattice_index) { return push.field.probe_index.at[lattice_index]; }
#endif
vec3 fetchPosition(int probe) { return push.field.positions.at[probe]; }
#endif
int fetchNearest(int index) { return push.field.nearest_probe.at[index]; }

vec3 fetchIrradiance(int probe, int texel) {
  const int side = PL_IRRADIANCE_TEXELS + 2 * PL_BORDER;
  return loadIrradiance(push.field.irradiance, uint(probe * side * side + texel));
}

vec2 fetchMoments(int probe, int texel) {
  const int side = PL_MOMENT_TEXELS + 2 * PL_BORDER;
  return loadMoments(push.field.moments, uint(probe * side * side + texel));
}

float fetchAhead(int probe, int texel) { return fetchMoments(probe, texel).x; }

#include "shared/query.h"

QueryResult queryField(QueryParams params, LatticeShape shape, vec3 position, vec3 normal,
                       vec3 view) {
#if PL_INTERPOLANT == PL_INTERPOLANT_SCATTERED
  return queryScattered(params, kModes, shape, position, normal, view);
#else
  return queryLattice(params, kModes, shape, position, normal, view);
#endif
}

// Counts a query that the weights of the cell's probes did not answer.
#define COUNT_ANSWER(counters, how) \
  if ((how) != PL_ANSWER_WEIGHED) atomicAdd((counters).answers[how], 1u)

#endif
