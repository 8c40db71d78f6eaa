// SPDX-License-Identifier: Apache-2.0
// The field at given points: irradiance and the sum of weights, negated where no probe answered.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/field.glsl"

BUFFER(BIND_POINTS, readonly, Points, QueryPoint points[]);
BUFFER(BIND_RESULTS, writeonly, Results, vec4 results[]);
BUFFER(BIND_COUNTERS, restrict, CounterBuffer, Counters counters);

layout(push_constant, scalar) uniform Push { uint item_count; } push;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
  QueryPoint point = points[i];
  QueryResult result =
      queryLattice(query_params, kModes, lattice, point.position, point.normal, point.view);
  if (result.fallback != 0) atomicAdd(counters.fallback_queries, 1u);
  else if (result.weight_sum < kTinyWeightSum) atomicAdd(counters.tiny_weight_sums, 1u);
  results[i] = vec4(result.irradiance, result.fallback != 0 ? -1.0 : result.weight_sum);
}
