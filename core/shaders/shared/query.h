// SPDX-License-Identifier: Apache-2.0
// The query of a lattice of probes: the weight of a probe, the reading of its texels, the average.
// Sources: [GDC19], [M19], [M21], [RTXGI]; each switch of QueryModes names its own.
//
// The field is reached through the includer:
//   GLSL  functions of these names, declared before this header
//   C++   the same as members of the type Field
//     int fetchProbe(int lattice_index)                 stored and active probe, -1: none
//     int fetchNearest(int lattice_index)               nearest active probe, -1: none at all
//     vec3 fetchPosition(int probe)                     where probes are off the lattice's points
//     vec3 fetchIrradiance(int probe, int texel)        as stored (encoded)
//     vec2 fetchMoments(int probe, int texel)           mean and mean square, in units of r_i
// and PL_CHEBYSHEV_HALVES, PL_DECODE_HALVES for powParameter.
//
// The loop over probes is written without branches: a software device runs both sides of each.
#ifndef PROBELAB_SHARED_QUERY_H
#define PROBELAB_SHARED_QUERY_H

#include "shared/octahedral.h"
#include "shared/query_params.h"

#ifdef __cplusplus
#define PL_FIELD_FUNCTION template <class Field, class T> inline
#define PL_FIELD_PARAM const Field &field,
#define PL_FIELD_ARG field,
#define PL_FETCH_PROBE(index) field.fetchProbe(index)
#define PL_FETCH_NEAREST(index) field.fetchNearest(index)
#define PL_FETCH_POSITION(probe) Vec3<T>(field.fetchPosition(probe))
#define PL_FETCH_IRRADIANCE(probe, texel) Vec3<T>(field.fetchIrradiance(probe, texel))
#define PL_FETCH_MOMENTS(probe, texel) Vec2<T>(field.fetchMoments(probe, texel))
#define PL_CHEBYSHEV_HALVES -1
#define PL_DECODE_HALVES -1
#else
#define PL_FIELD_FUNCTION
#define PL_FIELD_PARAM
#define PL_FIELD_ARG
#define PL_FETCH_PROBE(index) fetchProbe(index)
#define PL_FETCH_NEAREST(index) fetchNearest(index)
#define PL_FETCH_POSITION(probe) fetchPosition(probe)
#define PL_FETCH_IRRADIANCE(probe, texel) fetchIrradiance(probe, texel)
#define PL_FETCH_MOMENTS(probe, texel) fetchMoments(probe, texel)
#endif

PL_NAMESPACE_BEGIN

// One-sided Chebyshev bound on the share of the texel's distances beyond `distance`, raised to the
// power and floored. Everything in units of r_i.
PL_FUNCTION REAL visibilityWeight(QueryParams PL_OF_T params, VEC2 moments, REAL distance_r) {
  REAL mean = moments.x;
  REAL square = mean * mean;
  REAL variance = max(abs(moments.y - square), params.variance_floor * square) +
                  params.variance_bias;
  REAL excess = distance_r - mean;
  REAL bound = variance / (variance + excess * excess);
  REAL occluded = max(params.visibility_floor,
                      powParameter(bound, params.chebyshev_power, PL_CHEBYSHEV_HALVES));
  return distance_r <= mean ? REAL(1) : occluded;
}

PL_FUNCTION REAL facingWeight(QueryParams PL_OF_T params, REAL cosine) {
  REAL wrap = (cosine + REAL(1)) * REAL(0.5);
  return wrap * wrap + params.facing_offset;
}

PL_FUNCTION REAL crushWeight(QueryParams PL_OF_T params, REAL weight) {
  // The cube is the smaller one just below the threshold.
  return min(weight,
             weight * weight * weight / (params.crush_threshold * params.crush_threshold));
}

// Bilinear reading of the irradiance map, as stored (encoded).
PL_FIELD_FUNCTION VEC3 readIrradiance(PL_FIELD_PARAM int probe, OctTaps PL_OF_T t) {
  VEC3 top = PL_FETCH_IRRADIANCE(probe, t.texel_00) * (REAL(1) - t.fraction_x) +
             PL_FETCH_IRRADIANCE(probe, t.texel_10) * t.fraction_x;
  VEC3 bottom = PL_FETCH_IRRADIANCE(probe, t.texel_01) * (REAL(1) - t.fraction_x) +
                PL_FETCH_IRRADIANCE(probe, t.texel_11) * t.fraction_x;
  return top * (REAL(1) - t.fraction_y) + bottom * t.fraction_y;
}

// Bilinear reading of the mean and mean square of the distance, in units of r_i.
PL_FIELD_FUNCTION VEC2 readMoments(PL_FIELD_PARAM int probe, OctTaps PL_OF_T t) {
  VEC2 top = PL_FETCH_MOMENTS(probe, t.texel_00) * (REAL(1) - t.fraction_x) +
             PL_FETCH_MOMENTS(probe, t.texel_10) * t.fraction_x;
  VEC2 bottom = PL_FETCH_MOMENTS(probe, t.texel_01) * (REAL(1) - t.fraction_x) +
                PL_FETCH_MOMENTS(probe, t.texel_11) * t.fraction_x;
  return top * (REAL(1) - t.fraction_y) + bottom * t.fraction_y;
}

// Weight of the lattice point with index `corner` on one axis, at lattice coordinate x (clamped to
// the lattice): a tent over the two cells beside it. `place` is its top, the point itself or where
// its probe was moved to (same axis, within half a cell); the ends stay, so no cell's border shows.
PL_FUNCTION REAL axisWeight(REAL x, int corner, REAL place) {
  REAL low = REAL(corner) - REAL(1);
  REAL high = REAL(corner) + REAL(1);
  return x < place ? (x - low) / (place - low) : (high - x) / (high - place);
}

// Trilinear weight from those of the axes.
PL_FUNCTION REAL trilinearWeight(QueryParams PL_OF_T params, QueryModes modes, VEC3 axis) {
  if (modes.trilinear == PL_TRILINEAR_AXIS_MAX)
    return max(params.trilinear_floor, axis.x) * max(params.trilinear_floor, axis.y) *
           max(params.trilinear_floor, axis.z);
  REAL product = axis.x * axis.y * axis.z;
  return modes.trilinear == PL_TRILINEAR_PRODUCT_PLUS ? product + params.trilinear_floor : product;
}

// Weight of a probe: facing, visibility, crush and trilinear as the modes order them. `cosine`
// faces the query's normal to the probe; `visibility` is 1 where it is off.
PL_FUNCTION REAL probeWeight(QueryParams PL_OF_T params, QueryModes modes, REAL trilinear,
                             REAL cosine, REAL visibility) {
  REAL weight = modes.facing == PL_FACING_NONE ? REAL(1) : facingWeight(params, cosine);
  weight = weight * visibility;
  if (modes.crush == PL_CRUSH_BEFORE_TRILINEAR)
    return crushWeight(params, max(REAL(1e-6), weight)) * trilinear;
  weight = weight * trilinear;
  return modes.crush == PL_CRUSH_AFTER_TRILINEAR ? crushWeight(params, weight) : weight;
}

// Sums over the probes of a query: weighted values, and the same without visibility where the
// fallback asks for it.
PL_STRUCT QuerySums {
  VEC3 value;
  REAL weight;
  VEC3 unoccluded_value;
  REAL unoccluded_weight;
};

PL_FUNCTION void addProbe(PL_INOUT(QuerySums PL_OF_T) sums, QueryParams PL_OF_T params,
                          QueryModes modes, REAL trilinear, REAL cosine, REAL visibility,
                          VEC3 value) {
  REAL weight = probeWeight(params, modes, trilinear, cosine, visibility);
  if (modes.average == PL_AVERAGE_SQRT_OF_WEIGHTED) weight = sqrt(weight);
  sums.value = sums.value + value * weight;
  sums.weight = sums.weight + weight;
  if (modes.fallback != PL_FALLBACK_NONE) {
    REAL unoccluded = probeWeight(params, modes, trilinear, cosine, REAL(1));
    if (modes.average == PL_AVERAGE_SQRT_OF_WEIGHTED) unoccluded = sqrt(unoccluded);
    sums.unoccluded_value = sums.unoccluded_value + value * unoccluded;
    sums.unoccluded_weight = sums.unoccluded_weight + unoccluded;
  }
}

// Stored texel value -> the value that is averaged over probes (irradiance / pi, or its root).
PL_FUNCTION VEC3 decodeForAverage(QueryParams PL_OF_T params, VEC3 stored) {
  return powParameter(stored, params.decode_exponent, PL_DECODE_HALVES);
}

PL_FUNCTION VEC3 averageToIrradiance(QueryModes modes, VEC3 value, REAL weight) {
  VEC3 mean = value / weight;
  if (modes.average != PL_AVERAGE_LINEAR) mean = mean * mean;
  return mean * REAL(3.14159265358979323846);
}

// 1 inside the bounds, linear to 0 over one s_i outside, per axis.
PL_FUNCTION REAL boundsWeight(LatticeShape lattice, VEC3 p) {
  VEC3 low = VEC3(lattice.bounds_min) - p;
  VEC3 high = p - VEC3(lattice.bounds_max);
  REAL s = REAL(lattice.bias_length);
  REAL x = clamp(max(low.x, high.x) / s, REAL(0), REAL(1));
  REAL y = clamp(max(low.y, high.y) / s, REAL(0), REAL(1));
  REAL z = clamp(max(low.z, high.z) / s, REAL(0), REAL(1));
  return (REAL(1) - x) * (REAL(1) - y) * (REAL(1) - z);
}

PL_FUNCTION QueryResult PL_OF_T finishQuery(QueryModes modes, QuerySums PL_OF_T sums) {
  QueryResult PL_OF_T result;
  result.irradiance = VEC3(REAL(0));
  result.weight_sum = sums.weight;
  result.answer = PL_ANSWER_NONE;
  if (sums.weight > REAL(0)) {
    result.irradiance = averageToIrradiance(modes, sums.value, sums.weight);
    result.answer = PL_ANSWER_WEIGHED;
  }
  if (modes.fallback == PL_FALLBACK_NONE || sums.unoccluded_weight <= REAL(0)) return result;
  REAL share = sums.weight > REAL(0) ? REAL(1) : REAL(0);
  if (modes.fallback == PL_FALLBACK_LERP_UNOCCLUDED) share = min(sums.weight, REAL(1));
  if (share < REAL(1)) {
    VEC3 unoccluded =
        averageToIrradiance(modes, sums.unoccluded_value, sums.unoccluded_weight);
    result.irradiance = unoccluded * (REAL(1) - share) + result.irradiance * share;
    if (sums.weight <= REAL(0)) result.answer = PL_ANSWER_UNOCCLUDED;
  }
  return result;
}

// First corner of the cell of a lattice coordinate on one axis with `count` probes.
PL_FUNCTION int latticeCell(REAL coordinate, int count) {
  return min(max(floorToInt(coordinate), 0), max(count - 2, 0));
}

// What all probes of a query share.
PL_STRUCT QueryCell {
  VEC3 position;
  VEC3 biased;      // position with the biases
  VEC3 normal;
  VEC3 coordinate;  // of the biased position on the lattice, clamped to it
  int x;            // the cell's first corner
  int y;
  int z;
  OctTaps PL_OF_T normal_taps;
};

PL_FUNCTION QueryCell PL_OF_T makeQueryCell(QueryParams PL_OF_T params, LatticeShape lattice,
                                            VEC3 position, VEC3 normal, VEC3 view) {
  QueryCell PL_OF_T cell;
  cell.position = position;
  cell.normal = normal;
  cell.biased = position + (normal * params.normal_bias - view * params.view_bias) *
                               REAL(lattice.bias_length);
  VEC3 c = (cell.biased - VEC3(lattice.first)) / VEC3(lattice.spacing);
  cell.coordinate = VEC3(clamp(c.x, REAL(0), REAL(lattice.count_x - 1)),
                         clamp(c.y, REAL(0), REAL(lattice.count_y - 1)),
                         clamp(c.z, REAL(0), REAL(lattice.count_z - 1)));
  cell.x = latticeCell(cell.coordinate.x, lattice.count_x);
  cell.y = latticeCell(cell.coordinate.y, lattice.count_y);
  cell.z = latticeCell(cell.coordinate.z, lattice.count_z);
  cell.normal_taps = octTaps(normal, lattice.irradiance_texels, lattice.border);
  return cell;
}

// Weight of what a probe at `offset` from the biased point sees of it.
PL_FIELD_FUNCTION REAL probeVisibility(PL_FIELD_PARAM QueryParams PL_OF_T params,
                                       LatticeShape lattice, int probe, VEC3 offset) {
  REAL distance_sq = dot(offset, offset);
  if (distance_sq <= REAL(0)) offset = VEC3(REAL(0), REAL(0), REAL(-1));  // any direction
  OctTaps PL_OF_T taps = octTaps(offset * REAL(-1), lattice.moment_texels, lattice.border);
  REAL distance_r = distance_sq > REAL(0) ? sqrt(distance_sq) / REAL(lattice.support_radius)
                                          : REAL(0);
  return visibilityWeight(params, readMoments(PL_FIELD_ARG probe, taps), distance_r);
}

PL_FUNCTION REAL facingCosine(QueryModes modes, QueryCell PL_OF_T cell, VEC3 probe_position) {
  VEC3 to_probe =
      probe_position - (modes.facing == PL_FACING_WRAP_BIASED ? cell.biased : cell.position);
  REAL length_sq = dot(to_probe, to_probe);
  return length_sq > REAL(0) ? dot(to_probe, cell.normal) / sqrt(length_sq) : REAL(1);
}

// Adds the probe of lattice point (x, y, z), if it has one.
PL_FIELD_FUNCTION void addCorner(PL_FIELD_PARAM PL_INOUT(QuerySums PL_OF_T) sums,
                                 QueryParams PL_OF_T params, QueryModes modes,
                                 LatticeShape lattice, QueryCell PL_OF_T cell, int x, int y,
                                 int z) {
  bool inside = x < lattice.count_x && y < lattice.count_y && z < lattice.count_z;
  int point_index = inside ? (z * lattice.count_y + y) * lattice.count_x + x : 0;
  int stored = PL_FETCH_PROBE(point_index);
  bool usable = inside && stored >= 0;
  int probe = max(stored, 0);
  VEC3 point = VEC3(REAL(x), REAL(y), REAL(z));
  VEC3 probe_position = VEC3(lattice.first) + point * VEC3(lattice.spacing);
  if (modes.moved != 0) probe_position = PL_FETCH_POSITION(probe);
  VEC3 axis = VEC3(REAL(1) - abs(cell.coordinate.x - point.x),
                   REAL(1) - abs(cell.coordinate.y - point.y),
                   REAL(1) - abs(cell.coordinate.z - point.z));
  if (modes.moved != 0 && modes.offset_weights != 0) {
    VEC3 place = (probe_position - VEC3(lattice.first)) / VEC3(lattice.spacing);
    axis = VEC3(axisWeight(cell.coordinate.x, x, place.x),
                axisWeight(cell.coordinate.y, y, place.y),
                axisWeight(cell.coordinate.z, z, place.z));
  }
  REAL trilinear = trilinearWeight(params, modes, axis);
#ifdef __cplusplus
  // Where a weight is 0, automatic differentiation would divide by the root of it.
  if (!usable || trilinear <= REAL(0)) return;
#endif
  if (!usable) trilinear = REAL(0);
  REAL visibility = REAL(1);
  if (modes.visibility != 0)
    visibility = probeVisibility(PL_FIELD_ARG params, lattice, probe, probe_position - cell.biased);
  REAL cosine = REAL(1);
  if (modes.facing != PL_FACING_NONE) cosine = facingCosine(modes, cell, probe_position);
  VEC3 texel = readIrradiance(PL_FIELD_ARG probe, cell.normal_taps);
  addProbe(sums, params, modes, trilinear, cosine, visibility, decodeForAverage(params, texel));
}

// The answer of the nearest active probe, where the cell has none.
PL_FIELD_FUNCTION QueryResult PL_OF_T answerNearest(PL_FIELD_PARAM QueryParams PL_OF_T params,
                                                    QueryModes modes, LatticeShape lattice,
                                                    QueryCell PL_OF_T cell,
                                                    QueryResult PL_OF_T result) {
  int x = floorToInt(cell.coordinate.x + REAL(0.5));
  int y = floorToInt(cell.coordinate.y + REAL(0.5));
  int z = floorToInt(cell.coordinate.z + REAL(0.5));
  int probe = PL_FETCH_NEAREST((z * lattice.count_y + y) * lattice.count_x + x);
  if (probe < 0) return result;
  VEC3 stored = readIrradiance(PL_FIELD_ARG probe, cell.normal_taps);
  result.irradiance = averageToIrradiance(modes, decodeForAverage(params, stored), REAL(1));
  result.answer = PL_ANSWER_NEAREST;
  return result;
}

// Irradiance arriving at `position` (metres, relative to Scene::origin) on a surface with unit
// `normal`; `view` is the unit direction from the eye, or along the ray, to the point.
PL_FIELD_FUNCTION QueryResult PL_OF_T queryLattice(PL_FIELD_PARAM QueryParams PL_OF_T params,
                                                   QueryModes modes, LatticeShape lattice,
                                                   VEC3 position, VEC3 normal, VEC3 view) {
  QueryCell PL_OF_T cell = makeQueryCell(params, lattice, position, normal, view);
  QuerySums PL_OF_T sums;
  sums.value = VEC3(REAL(0));
  sums.weight = REAL(0);
  sums.unoccluded_value = VEC3(REAL(0));
  sums.unoccluded_weight = REAL(0);
  for (int corner = 0; corner < 8; ++corner)
    addCorner(PL_FIELD_ARG sums, params, modes, lattice, cell, cell.x + (corner & 1),
              cell.y + ((corner >> 1) & 1), cell.z + (corner >> 2));
  QueryResult PL_OF_T result = finishQuery(modes, sums);
  if (modes.fallback == PL_FALLBACK_NEAREST && result.answer == PL_ANSWER_NONE)
    result = answerNearest(PL_FIELD_ARG params, modes, lattice, cell, result);
  result.irradiance = result.irradiance * boundsWeight(lattice, position);
  return result;
}

PL_NAMESPACE_END

#endif
