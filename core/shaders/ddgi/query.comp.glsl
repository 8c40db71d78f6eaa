// SPDX-License-Identifier: Apache-2.0
// The field at given points: irradiance and the sum of weights, negated where the probes' weights
// gave no answer.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"

REFERENCE(readonly, PointArray, QueryPoint);
layout(push_constant, scalar) uniform Push {
  uint item_count;
  uint unused;
  FieldAddresses field;
  PointArray points;
} push;

#include "ddgi/field.glsl"

BUFFER(BIND_RESULTS, writeonly, Results, vec4 results[]);
BUFFER(BIND_COUNTERS, restrict, CounterBuffer, CounterData counters);

void main() {
  QueryParams params = query_params;
  LatticeShape shape = specialisedLattice();
  uint i = min(gl_GlobalInvocationID.x, push.item_count - 1u);
  QueryPoint point = push.points.at[i];
  QueryResult result = queryField(params, shape, point.position, point.normal, point.view);
  if (gl_GlobalInvocationID.x >= push.item_count) return;
  COUNT_ANSWER(counters, result.answer);
  if (result.answer == PL_ANSWER_WEIGHED && result.weight_sum < kTinyWeightSum)
    atomicAdd(counters.tiny_weight_sums, 1u);
  results[i] =
      vec4(result.irradiance, result.answer == PL_ANSWER_WEIGHED ? result.weight_sum : -1.0);
}
