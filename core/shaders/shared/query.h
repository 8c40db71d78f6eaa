// SPDX-License-Identifier: Apache-2.0
// The query of a lattice of probes: the weight of a probe, the reading of its texels, the average.
// Sources: [GDC19], [M19], [M21], [RTXGI]; each switch of QueryModes names its own.
//
// The atlases are reached through the includer:
//   GLSL  int fetchProbe(int lattice_index), vec3 fetchIrradiance(int probe, int x, int y),
//         vec2 fetchMoments(int probe, int x, int y), declared before this header
//   C++   the same three as members of the type Field
#ifndef PROBELAB_SHARED_QUERY_H
#define PROBELAB_SHARED_QUERY_H

#include "shared/octahedral.h"
#include "shared/query_params.h"

#ifdef __cplusplus
#define PL_FIELD_FUNCTION template <class Field, class T> inline
#define PL_FIELD_PARAM const Field &field,
#define PL_FIELD_ARG field,
#define PL_FETCH_PROBE(index) field.fetchProbe(index)
#define PL_FETCH_IRRADIANCE(probe, x, y) Vec3<T>(field.fetchIrradiance(probe, x, y))
#define PL_FETCH_MOMENTS(probe, x, y) Vec2<T>(field.fetchMoments(probe, x, y))
#else
#define PL_FIELD_FUNCTION
#define PL_FIELD_PARAM
#define PL_FIELD_ARG
#define PL_FETCH_PROBE(index) fetchProbe(index)
#define PL_FETCH_IRRADIANCE(probe, x, y) fetchIrradiance(probe, x, y)
#define PL_FETCH_MOMENTS(probe, x, y) fetchMoments(probe, x, y)
#endif

PL_NAMESPACE_BEGIN

// One-sided Chebyshev bound on the share of the texel's distances beyond `distance`, raised to the
// power and floored. Everything in units of r_i.
PL_FUNCTION REAL visibilityWeight(QueryParams PL_OF_T params, VEC2 moments, REAL distance_r) {
  REAL mean = moments.x;
  if (distance_r <= mean) return REAL(1);
  REAL variance = max(abs(moments.y - mean * mean), params.variance_floor * mean * mean) +
                  params.variance_bias;
  REAL excess = distance_r - mean;
  REAL bound = variance / (variance + excess * excess);
  return max(params.visibility_floor, pow(bound, params.chebyshev_power));
}

PL_FUNCTION REAL facingWeight(QueryParams PL_OF_T params, REAL cosine) {
  REAL wrap = (cosine + REAL(1)) * REAL(0.5);
  return wrap * wrap + params.facing_offset;
}

PL_FUNCTION REAL crushWeight(QueryParams PL_OF_T params, REAL weight) {
  if (weight >= params.crush_threshold) return weight;
  return weight * weight * weight / (params.crush_threshold * params.crush_threshold);
}

// Bilinear reading of the irradiance map, as stored (encoded).
PL_FIELD_FUNCTION VEC3 readIrradiance(PL_FIELD_PARAM int probe, OctTaps PL_OF_T t) {
  VEC3 top = PL_FETCH_IRRADIANCE(probe, t.x, t.y) * (REAL(1) - t.fraction_x) +
             PL_FETCH_IRRADIANCE(probe, t.x + 1, t.y) * t.fraction_x;
  VEC3 bottom = PL_FETCH_IRRADIANCE(probe, t.x, t.y + 1) * (REAL(1) - t.fraction_x) +
                PL_FETCH_IRRADIANCE(probe, t.x + 1, t.y + 1) * t.fraction_x;
  return top * (REAL(1) - t.fraction_y) + bottom * t.fraction_y;
}

// Bilinear reading of the mean and mean square of the distance, in units of r_i.
PL_FIELD_FUNCTION VEC2 readMoments(PL_FIELD_PARAM int probe, OctTaps PL_OF_T t) {
  VEC2 top = PL_FETCH_MOMENTS(probe, t.x, t.y) * (REAL(1) - t.fraction_x) +
             PL_FETCH_MOMENTS(probe, t.x + 1, t.y) * t.fraction_x;
  VEC2 bottom = PL_FETCH_MOMENTS(probe, t.x, t.y + 1) * (REAL(1) - t.fraction_x) +
                PL_FETCH_MOMENTS(probe, t.x + 1, t.y + 1) * t.fraction_x;
  return top * (REAL(1) - t.fraction_y) + bottom * t.fraction_y;
}

// Trilinear weight of the corner (ox, oy, oz) in {0, 1}^3.
PL_FUNCTION REAL trilinearWeight(QueryParams PL_OF_T params, QueryModes modes, VEC3 alpha, int ox,
                                 int oy, int oz) {
  REAL x = ox == 1 ? alpha.x : REAL(1) - alpha.x;
  REAL y = oy == 1 ? alpha.y : REAL(1) - alpha.y;
  REAL z = oz == 1 ? alpha.z : REAL(1) - alpha.z;
  if (modes.trilinear == PL_TRILINEAR_AXIS_MAX)
    return max(params.trilinear_floor, x) * max(params.trilinear_floor, y) *
           max(params.trilinear_floor, z);
  if (modes.trilinear == PL_TRILINEAR_PRODUCT_PLUS) return x * y * z + params.trilinear_floor;
  return x * y * z;
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

// Sums over the probes of a query: weighted values, and the same without visibility for the
// fallback.
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
  if (modes.fallback == PL_FALLBACK_LERP_UNOCCLUDED) {
    REAL unoccluded = probeWeight(params, modes, trilinear, cosine, REAL(1));
    if (modes.average == PL_AVERAGE_SQRT_OF_WEIGHTED) unoccluded = sqrt(unoccluded);
    sums.unoccluded_value = sums.unoccluded_value + value * unoccluded;
    sums.unoccluded_weight = sums.unoccluded_weight + unoccluded;
  }
}

// Stored texel value -> the value that is averaged over probes (irradiance / pi, or its root).
PL_FUNCTION VEC3 decodeForAverage(QueryParams PL_OF_T params, VEC3 stored) {
  if (params.decode_exponent == REAL(1)) return stored;
  if (params.decode_exponent == REAL(0.5)) return sqrt(stored);
  return pow(stored, VEC3(params.decode_exponent));
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

PL_FUNCTION QueryResult PL_OF_T finishQuery(QueryModes modes, QuerySums PL_OF_T sums, REAL bounds) {
  QueryResult PL_OF_T result;
  result.irradiance = VEC3(REAL(0));
  result.weight_sum = sums.weight;
  result.fallback = 1;
  if (sums.weight > REAL(0)) {
    result.irradiance = averageToIrradiance(modes, sums.value, sums.weight);
    result.fallback = 0;
  }
  if (modes.fallback == PL_FALLBACK_LERP_UNOCCLUDED && sums.unoccluded_weight > REAL(0)) {
    VEC3 unoccluded =
        averageToIrradiance(modes, sums.unoccluded_value, sums.unoccluded_weight);
    REAL share = min(sums.weight, REAL(1));
    result.irradiance = unoccluded * (REAL(1) - share) + result.irradiance * share;
    result.fallback = 0;
  }
  result.irradiance = result.irradiance * bounds;
  return result;
}

// Cell and fraction of a lattice coordinate on one axis with `count` probes.
PL_FUNCTION int latticeCell(REAL coordinate, int count) {
  return min(max(floorToInt(coordinate), 0), max(count - 2, 0));
}

// Irradiance [lux-like, metres] arriving at `position` (relative to Scene::origin) on a surface with
// unit `normal`; `view` is the unit direction from the eye, or along the ray, to the point.
PL_FIELD_FUNCTION QueryResult PL_OF_T queryLattice(PL_FIELD_PARAM QueryParams PL_OF_T params,
                                                   QueryModes modes, LatticeShape lattice,
                                                   VEC3 position, VEC3 normal, VEC3 view) {
  VEC3 biased = position + (normal * params.normal_bias - view * params.view_bias) *
                               REAL(lattice.bias_length);
  VEC3 coordinate = (biased - VEC3(lattice.first)) / VEC3(lattice.spacing);
  int cell_x = latticeCell(coordinate.x, lattice.count_x);
  int cell_y = latticeCell(coordinate.y, lattice.count_y);
  int cell_z = latticeCell(coordinate.z, lattice.count_z);
  VEC3 alpha = VEC3(clamp(coordinate.x - REAL(cell_x), REAL(0), REAL(1)),
                    clamp(coordinate.y - REAL(cell_y), REAL(0), REAL(1)),
                    clamp(coordinate.z - REAL(cell_z), REAL(0), REAL(1)));
  OctTaps PL_OF_T normal_taps = octTaps(normal, lattice.irradiance_texels);
  QuerySums PL_OF_T sums;
  sums.value = VEC3(REAL(0));
  sums.weight = REAL(0);
  sums.unoccluded_value = VEC3(REAL(0));
  sums.unoccluded_weight = REAL(0);
  for (int corner = 0; corner < 8; ++corner) {
    int ox = corner & 1;
    int oy = (corner >> 1) & 1;
    int oz = corner >> 2;
    int x = cell_x + ox;
    int y = cell_y + oy;
    int z = cell_z + oz;
    if (x >= lattice.count_x || y >= lattice.count_y || z >= lattice.count_z) continue;
    REAL trilinear = trilinearWeight(params, modes, alpha, ox, oy, oz);
    if (trilinear <= REAL(0)) continue;
    int probe = PL_FETCH_PROBE((z * lattice.count_y + y) * lattice.count_x + x);
    if (probe < 0) continue;
    VEC3 probe_position =
        VEC3(lattice.first) + VEC3(REAL(x), REAL(y), REAL(z)) * VEC3(lattice.spacing);
    VEC3 offset = probe_position - biased;
    REAL visibility = REAL(1);
    if (modes.visibility != 0) {
      REAL distance_m = sqrt(dot(offset, offset));
      if (distance_m > REAL(0)) {
        VEC3 from_probe = offset * (REAL(-1) / distance_m);
        VEC2 moments =
            readMoments(PL_FIELD_ARG probe, octTaps(from_probe, lattice.moment_texels));
        visibility =
            visibilityWeight(params, moments, distance_m / REAL(lattice.support_radius));
      }
    }
    REAL cosine = REAL(1);
    if (modes.facing != PL_FACING_NONE) {
      VEC3 to_probe = modes.facing == PL_FACING_WRAP_BIASED ? offset : probe_position - position;
      REAL length_sq = dot(to_probe, to_probe);
      if (length_sq > REAL(0)) cosine = dot(to_probe, normal) / sqrt(length_sq);
    }
    VEC3 stored = readIrradiance(PL_FIELD_ARG probe, normal_taps);
    addProbe(sums, params, modes, trilinear, cosine, visibility,
             decodeForAverage(params, stored));
  }
  return finishQuery(modes, sums, boundsWeight(lattice, position));
}

PL_NAMESPACE_END

#endif
