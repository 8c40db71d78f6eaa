// SPDX-License-Identifier: Apache-2.0
// The query of a lattice of probes, or of scattered ones: which probes count at a point and how much
// each is of the interpolation, the weight of a probe, the reading of its texels, the average.
// Sources: [GDC19], [M19], [M21], [RTXGI]; each switch of QueryModes names its own.
//
// The field is reached through the includer:
//   GLSL  functions of these names, declared before this header
//   C++   the same as members of the type Field
//     int fetchProbe(int lattice_index)                 stored and active probe, -1: none
//     int fetchNearest(int index)                       nearest active probe of a lattice point or
//                                                       a voxel, -1: none at all
//     vec3 fetchPosition(int probe)                     where probes are off the lattice's points
//     uint fetchVoxelBegin(int piece)                   first entry of a voxel or of its piece
//     VoxelEntry fetchEntry(uint index)
//     int fetchPlaneOfVoxel(int voxel)                  -1: no wall divides it
//     vec4 fetchPlane(int plane)
//     vec4 fetchPlace(int probe)                        a scattered probe's position and s_i
//     vec3 fetchIrradiance(int probe, int texel)        as stored (encoded)
//     vec2 fetchMoments(int probe, int texel)           mean and mean square, in units of r_i
//     float fetchAhead(int probe, int texel)            mean alone, for parallax
// and PL_CHEBYSHEV_HALVES, PL_DECODE_HALVES for powParameter. GLSL has the query of PL_INTERPOLANT
// alone, C++ both; a Field needs only the members that its query calls.
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
#define PL_FETCH_VOXEL_BEGIN(voxel) field.fetchVoxelBegin(voxel)
#define PL_FETCH_ENTRY(index) field.fetchEntry(index)
#define PL_FETCH_PLANE_OF_VOXEL(voxel) field.fetchPlaneOfVoxel(voxel)
#define PL_FETCH_PLANE(plane) Vec4<T>(field.fetchPlane(plane))
#define PL_FETCH_PLACE(probe) Vec4<T>(field.fetchPlace(probe))
#define PL_FETCH_IRRADIANCE(probe, texel) Vec3<T>(field.fetchIrradiance(probe, texel))
#define PL_FETCH_MOMENTS(probe, texel) Vec2<T>(field.fetchMoments(probe, texel))
#define PL_FETCH_AHEAD(probe, texel) T(field.fetchAhead(probe, texel))
#define PL_CHEBYSHEV_HALVES (-1)
#define PL_DECODE_HALVES (-1)
#define PL_HAS_LATTICE 1
#define PL_HAS_SCATTERED 1
#else
#define PL_FIELD_FUNCTION
#define PL_FIELD_PARAM
#define PL_FIELD_ARG
#define PL_FETCH_PROBE(index) fetchProbe(index)
#define PL_FETCH_NEAREST(index) fetchNearest(index)
#define PL_FETCH_POSITION(probe) fetchPosition(probe)
#define PL_FETCH_VOXEL_BEGIN(voxel) fetchVoxelBegin(voxel)
#define PL_FETCH_ENTRY(index) fetchEntry(index)
#define PL_FETCH_PLANE_OF_VOXEL(voxel) fetchPlaneOfVoxel(voxel)
#define PL_FETCH_PLANE(plane) fetchPlane(plane)
#define PL_FETCH_PLACE(probe) fetchPlace(probe)
#define PL_HAS_LATTICE (PL_INTERPOLANT == PL_INTERPOLANT_LATTICE)
#define PL_HAS_SCATTERED (PL_INTERPOLANT == PL_INTERPOLANT_SCATTERED)
#define PL_FETCH_IRRADIANCE(probe, texel) fetchIrradiance(probe, texel)
#define PL_FETCH_MOMENTS(probe, texel) fetchMoments(probe, texel)
#define PL_FETCH_AHEAD(probe, texel) fetchAhead(probe, texel)
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

// Weight of a probe: facing, visibility, crush and `share`, its weight in the interpolation, as the
// modes order them. `cosine` faces the query's normal to the probe; `visibility` is 1 where it is
// off.
PL_FUNCTION REAL probeWeight(QueryParams PL_OF_T params, QueryModes modes, REAL share, REAL cosine,
                             REAL visibility) {
  REAL weight = modes.facing == PL_FACING_NONE ? REAL(1) : facingWeight(params, cosine);
  weight = weight * visibility;
  if (modes.crush == PL_CRUSH_BEFORE_TRILINEAR)
    return crushWeight(params, max(REAL(1e-6), weight)) * share;
  weight = weight * share;
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

PL_FUNCTION QuerySums PL_OF_T noSums(VEC3 zero) {
  QuerySums PL_OF_T sums;
  sums.value = zero;
  sums.weight = zero.x;
  sums.unoccluded_value = zero;
  sums.unoccluded_weight = zero.x;
  return sums;
}

PL_FUNCTION void addProbe(PL_INOUT(QuerySums PL_OF_T) sums, QueryParams PL_OF_T params,
                          QueryModes modes, REAL share, REAL cosine, REAL visibility,
                          VEC3 value) {
  REAL weight = probeWeight(params, modes, share, cosine, visibility);
  if (modes.average == PL_AVERAGE_SQRT_OF_WEIGHTED) weight = sqrt(weight);
  sums.value = sums.value + value * weight;
  sums.weight = sums.weight + weight;
  if (modes.fallback != PL_FALLBACK_NONE) {
    REAL unoccluded = probeWeight(params, modes, share, cosine, REAL(1));
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

// First corner of the cell of a lattice coordinate on one axis with `count` points.
PL_FUNCTION int latticeCell(REAL coordinate, int count) {
  return min(max(floorToInt(coordinate), 0), max(count - 2, 0));
}

// What all probes of a query share.
PL_STRUCT QueryCell {
  VEC3 position;
  VEC3 bias;        // of the position, x s_i
  VEC3 biased;      // position with the biases in the layout's s_i
  VEC3 normal;
  VEC3 looked_up;   // where the probes are looked up
  VEC3 coordinate;  // of that place on the lattice, clamped to it
  int x;            // the cell's first corner
  int y;
  int z;
  OctTaps PL_OF_T normal_taps;
  OctTaps PL_OF_T ahead_taps;  // of the moments, for parallax
};

// The place by which a query finds its probes: the biased point. Where walls divide voxels [ours],
// the point itself, a thousandth of the layout's s_i off its surface: biases lead through a wall
// that is nearer than they are long, and what is behind it would answer.
PL_FUNCTION VEC3 lookupPlace(int walls, REAL bias_length, VEC3 position, VEC3 normal, VEC3 biased) {
  return walls != 0 ? position + normal * (bias_length * REAL(1e-3)) : biased;
}

PL_FUNCTION QueryCell PL_OF_T makeQueryCell(QueryParams PL_OF_T params, QueryModes modes,
                                            LatticeShape lattice, VEC3 position, VEC3 normal,
                                            VEC3 view) {
  QueryCell PL_OF_T cell;
  cell.position = position;
  cell.normal = normal;
  cell.bias = normal * params.normal_bias - view * params.view_bias;
  cell.biased = position + cell.bias * REAL(lattice.bias_length);
#if PL_HAS_SCATTERED
  cell.looked_up =
      lookupPlace(modes.walls, REAL(lattice.bias_length), position, normal, cell.biased);
#else
  cell.looked_up = cell.biased;
#endif
  VEC3 c = (cell.looked_up - VEC3(lattice.first)) / VEC3(lattice.spacing);
  cell.coordinate = VEC3(clamp(c.x, REAL(0), REAL(lattice.count_x - 1)),
                         clamp(c.y, REAL(0), REAL(lattice.count_y - 1)),
                         clamp(c.z, REAL(0), REAL(lattice.count_z - 1)));
  cell.x = latticeCell(cell.coordinate.x, lattice.count_x);
  cell.y = latticeCell(cell.coordinate.y, lattice.count_y);
  cell.z = latticeCell(cell.coordinate.z, lattice.count_z);
  cell.normal_taps = octTaps(normal, lattice.irradiance_texels, lattice.border);
  cell.ahead_taps = octTaps(normal, max(lattice.moment_texels, 1), lattice.border);
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

PL_FUNCTION REAL facingCosine(QueryModes modes, QueryCell PL_OF_T cell, VEC3 biased,
                              VEC3 probe_position) {
  VEC3 to_probe =
      probe_position - (modes.facing == PL_FACING_WRAP_BIASED ? biased : cell.position);
  REAL length_sq = dot(to_probe, to_probe);
  return length_sq > REAL(0) ? dot(to_probe, cell.normal) / sqrt(length_sq) : REAL(1);
}

// [ours] The direction in which a probe reads its irradiance. What lies straight ahead of a point at
// the distance `ahead` that the probe sees there is seen by the probe aside of the normal, by the
// part of its offset across it; `offset` leads from the probe to the point. Any positive length.
PL_FUNCTION VEC3 parallaxDirection(QueryParams PL_OF_T params, VEC3 normal, VEC3 offset,
                                   REAL ahead) {
  VEC3 aside = offset - normal * dot(offset, normal);
  REAL far_sq = ahead * ahead + dot(aside, aside);
  REAL scale = far_sq > REAL(0) ? params.parallax / sqrt(far_sq) : REAL(0);
  return normal + aside * scale;
}

// Mean distance that a probe has stored in a direction, in metres.
PL_FIELD_FUNCTION REAL readAhead(PL_FIELD_PARAM LatticeShape lattice, int probe,
                                 OctTaps PL_OF_T t) {
  REAL top = PL_FETCH_AHEAD(probe, t.texel_00) * (REAL(1) - t.fraction_x) +
             PL_FETCH_AHEAD(probe, t.texel_10) * t.fraction_x;
  REAL bottom = PL_FETCH_AHEAD(probe, t.texel_01) * (REAL(1) - t.fraction_x) +
                PL_FETCH_AHEAD(probe, t.texel_11) * t.fraction_x;
  return (top * (REAL(1) - t.fraction_y) + bottom * t.fraction_y) * REAL(lattice.support_radius);
}

PL_FIELD_FUNCTION OctTaps PL_OF_T parallaxTaps(PL_FIELD_PARAM QueryParams PL_OF_T params,
                                               LatticeShape lattice, QueryCell PL_OF_T cell,
                                               int probe, VEC3 probe_position) {
  REAL ahead = readAhead(PL_FIELD_ARG lattice, probe, cell.ahead_taps);
  VEC3 direction =
      parallaxDirection(params, cell.normal, cell.position - probe_position, ahead);
  return octTaps(direction, lattice.irradiance_texels, lattice.border);
}

// Adds a probe whose weight in the interpolation is `share`; `biased` is the query's position with
// the biases in the probe's own s_i.
PL_FIELD_FUNCTION void queryProbe(PL_FIELD_PARAM PL_INOUT(QuerySums PL_OF_T) sums,
                                  QueryParams PL_OF_T params, QueryModes modes,
                                  LatticeShape lattice, QueryCell PL_OF_T cell, int probe,
                                  REAL share, VEC3 probe_position, VEC3 biased) {
#ifdef __cplusplus
  // Where a weight is 0, automatic differentiation would divide by the root of it.
  if (share <= REAL(0)) return;
#endif
  REAL visibility = REAL(1);
  if (modes.visibility != 0)
    visibility = probeVisibility(PL_FIELD_ARG params, lattice, probe, probe_position - biased);
  REAL cosine = REAL(1);
  if (modes.facing != PL_FACING_NONE) cosine = facingCosine(modes, cell, biased, probe_position);
  OctTaps PL_OF_T taps = cell.normal_taps;
  if (modes.parallax != 0)
    taps = parallaxTaps(PL_FIELD_ARG params, lattice, cell, probe, probe_position);
  VEC3 texel = readIrradiance(PL_FIELD_ARG probe, taps);
  addProbe(sums, params, modes, share, cosine, visibility, decodeForAverage(params, texel));
}

// The query's result from the sums; `nearest` is the lattice point or voxel whose nearest probe
// answers where no probe has a weight.
PL_FIELD_FUNCTION QueryResult PL_OF_T answerQuery(PL_FIELD_PARAM QueryParams PL_OF_T params,
                                                  QueryModes modes, LatticeShape lattice,
                                                  QueryCell PL_OF_T cell,
                                                  QuerySums PL_OF_T sums, int nearest) {
  QueryResult PL_OF_T result = finishQuery(modes, sums);
  if (modes.fallback == PL_FALLBACK_NEAREST && result.answer == PL_ANSWER_NONE) {
    int probe = PL_FETCH_NEAREST(nearest);
    if (probe >= 0) {
      VEC3 stored = readIrradiance(PL_FIELD_ARG probe, cell.normal_taps);
      result.irradiance = averageToIrradiance(modes, decodeForAverage(params, stored), REAL(1));
      result.answer = PL_ANSWER_NEAREST;
    }
  }
  result.irradiance = result.irradiance * boundsWeight(lattice, cell.position);
  return result;
}

// Both queries: irradiance arriving at `position` (metres, relative to Scene::origin) on a surface
// with unit `normal`; `view` is the unit direction from the eye, or along the ray, to the point.

#if PL_HAS_LATTICE
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
  REAL share = usable ? trilinearWeight(params, modes, axis) : REAL(0);
  queryProbe(PL_FIELD_ARG sums, params, modes, lattice, cell, probe, share, probe_position,
             cell.biased);
}

PL_FIELD_FUNCTION QueryResult PL_OF_T queryLattice(PL_FIELD_PARAM QueryParams PL_OF_T params,
                                                   QueryModes modes, LatticeShape lattice,
                                                   VEC3 position, VEC3 normal, VEC3 view) {
  QueryCell PL_OF_T cell = makeQueryCell(params, modes, lattice, position, normal, view);
  QuerySums PL_OF_T sums = noSums(VEC3(REAL(0)));
  for (int corner = 0; corner < 8; ++corner)
    addCorner(PL_FIELD_ARG sums, params, modes, lattice, cell, cell.x + (corner & 1),
              cell.y + ((corner >> 1) & 1), cell.z + (corner >> 2));
  int x = floorToInt(cell.coordinate.x + REAL(0.5));
  int y = floorToInt(cell.coordinate.y + REAL(0.5));
  int z = floorToInt(cell.coordinate.z + REAL(0.5));
  return answerQuery(PL_FIELD_ARG params, modes, lattice, cell, sums,
                     (z * lattice.count_y + y) * lattice.count_x + x);
}
#endif

#if PL_HAS_SCATTERED
// Squares of an entry's four bytes against the trilinear weights of their corners.
PL_FUNCTION REAL weighBytes(VEC4 corners, uint bytes) {
  VEC4 roots = VEC4(REAL(int(bytes & 255u)), REAL(int((bytes >> 8) & 255u)),
                    REAL(int((bytes >> 16) & 255u)), REAL(int(bytes >> 24)));
  return dot(corners * roots, roots);
}

// The voxel of the cell, or its piece on the side of the wall where the point is looked up.
PL_FIELD_FUNCTION int voxelPiece(PL_FIELD_PARAM QueryModes modes, LatticeShape lattice,
                                 QueryCell PL_OF_T cell) {
  int voxel = (cell.z * (lattice.count_y - 1) + cell.y) * (lattice.count_x - 1) + cell.x;
  if (modes.walls == 0) return voxel;
  int voxels = (lattice.count_x - 1) * (lattice.count_y - 1) * (lattice.count_z - 1);
  int plane = PL_FETCH_PLANE_OF_VOXEL(voxel);
  VEC4 wall = PL_FETCH_PLANE(max(plane, 0));
  REAL side = dot(VEC3(wall.x, wall.y, wall.z), cell.looked_up - VEC3(lattice.first)) + wall.w;
  return plane >= 0 && side < REAL(0) ? voxels + plane : voxel;
}

PL_FIELD_FUNCTION QueryResult PL_OF_T queryScattered(PL_FIELD_PARAM QueryParams PL_OF_T params,
                                                     QueryModes modes, LatticeShape lattice,
                                                     VEC3 position, VEC3 normal, VEC3 view) {
  QueryCell PL_OF_T cell = makeQueryCell(params, modes, lattice, position, normal, view);
  QuerySums PL_OF_T sums = noSums(VEC3(REAL(0)));
  VEC3 high = cell.coordinate - VEC3(REAL(cell.x), REAL(cell.y), REAL(cell.z));
  VEC3 low = VEC3(REAL(1)) - high;
  VEC4 layer = VEC4(low.x * low.y, high.x * low.y, low.x * high.y, high.x * high.y) *
               REAL(1.0 / (PL_WEIGHT_ONE * PL_WEIGHT_ONE));
  int voxel = voxelPiece(PL_FIELD_ARG modes, lattice, cell);
  uint end = PL_FETCH_VOXEL_BEGIN(voxel + 1);
  for (uint e = PL_FETCH_VOXEL_BEGIN(voxel); e < end; ++e) {
    VoxelEntry entry = PL_FETCH_ENTRY(e);
    int probe = int(entry.probe);
    VEC4 place = PL_FETCH_PLACE(probe);
    REAL share = weighBytes(layer * low.z, entry.weights_low) +
                 weighBytes(layer * high.z, entry.weights_high);
    queryProbe(PL_FIELD_ARG sums, params, modes, lattice, cell, probe, share,
               VEC3(place.x, place.y, place.z), position + cell.bias * place.w);
  }
  return answerQuery(PL_FIELD_ARG params, modes, lattice, cell, sums, voxel);
}
#endif

PL_NAMESPACE_END

#endif
