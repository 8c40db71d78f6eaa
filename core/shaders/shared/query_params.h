// SPDX-License-Identifier: Apache-2.0
// What a query of the field depends on besides the atlases. The continuous parameters are on the
// shared scalar, so that they can be tuned; the modes are integers, compile-time constants in GLSL.
#ifndef PROBELAB_SHARED_QUERY_PARAMS_H
#define PROBELAB_SHARED_QUERY_PARAMS_H

#include "shared/ray.h"

PL_NAMESPACE_BEGIN

// Meaning, units and ranges: core/ddgi/params.cpp, which is also where the presets are read.
PL_STRUCT QueryParams {
  REAL normal_bias;        // x s_i
  REAL view_bias;          // x s_i
  REAL facing_offset;
  REAL trilinear_floor;
  REAL chebyshev_power;
  REAL visibility_floor;
  REAL variance_bias;      // x r_i^2, added to the variance
  REAL variance_floor;     // x mean^2, from the moments' format
  REAL crush_threshold;
  REAL decode_exponent;    // stored value -> averaged value
  REAL parallax;           // share of a probe's offset that its reading makes up for
};

#define PL_FACING_NONE 0
#define PL_FACING_WRAP 1         // ((d.n + 1) / 2)^2 + facing_offset, seen from the query point
#define PL_FACING_WRAP_BIASED 2  // the same, seen from the biased point [GDC19]

#define PL_TRILINEAR_PLAIN 0
#define PL_TRILINEAR_PRODUCT_PLUS 1  // product + trilinear_floor [GDC19]
#define PL_TRILINEAR_AXIS_MAX 2      // product of max(trilinear_floor, .) [RTXGI]

#define PL_CRUSH_NONE 0
#define PL_CRUSH_AFTER_TRILINEAR 1   // [GDC19]
#define PL_CRUSH_BEFORE_TRILINEAR 2  // [M21], [RTXGI]

#define PL_AVERAGE_LINEAR 0
#define PL_AVERAGE_SQRT 1              // (sum w sqrt(E) / sum w)^2 [RTXGI]
#define PL_AVERAGE_SQRT_OF_WEIGHTED 2  // (sum sqrt(w E) / sum sqrt(w))^2 [GDC19]

#define PL_FALLBACK_NONE 0
#define PL_FALLBACK_LERP_UNOCCLUDED 1  // towards the result without visibility [GDC19]
#define PL_FALLBACK_NEAREST 2  // the cell without visibility, else the nearest active probe

#define PL_MOMENTS_RAW 0      // mean and mean square [M19]
#define PL_MOMENTS_CENTRAL 1  // mean and standard deviation

// Which probes gave a query's answer.
#define PL_ANSWER_WEIGHED 0    // those of the cell, by their weights
#define PL_ANSWER_NONE 1       // none: the irradiance is 0
#define PL_ANSWER_UNOCCLUDED 2 // all weights were 0: those of the cell without visibility
#define PL_ANSWER_NEAREST 3    // the cell has no active probe: the nearest one

// How the weights of the probes around a point are found.
#define PL_INTERPOLANT_LATTICE 0    // trilinear in the lattice's cell
#define PL_INTERPOLANT_SCATTERED 1  // from the entries of a voxel (ddgi/influence.h)

struct QueryModes {
  int facing;
  int trilinear;
  int visibility;  // 0: off
  int crush;
  int average;
  int fallback;
  int moved;  // 1: probes are not on the lattice's points, positions are fetched
  int offset_weights;  // 1: interpolation weights peak at the moved positions
  int walls;           // 1: voxels may be divided by walls (scattered probes)
  int parallax;        // 1: irradiance is read towards what the query's point faces
};

// The lattice and the atlases' sizes. Positions in metres relative to Scene::origin. With scattered
// probes the lattice is that of the voxels' corners, s_i the mean and r_i the largest of all probes.
struct LatticeShape {
  PL_FLOAT3 first;  // position of probe (0, 0, 0)
  float bias_length;  // s_i in metres
  PL_FLOAT3 spacing;
  float support_radius;  // r_i in metres, the unit of stored distances
  PL_FLOAT3 bounds_min;
  int count_x;
  PL_FLOAT3 bounds_max;
  int count_y;
  int count_z;
  int irradiance_texels;  // interior texels a side
  int moment_texels;
  int border;  // texels around the interior as stored, 0 or 1
};

// A probe in one voxel: a byte for its weight at each of the voxel's corners x + 2 y + 4 z, the first
// one lowest; a weight is (byte / PL_WEIGHT_ONE)^2.
#define PL_WEIGHT_ONE 128.0
struct VoxelEntry {
  PL_UINT probe;
  PL_UINT weights_low;   // corners 0 to 3
  PL_UINT weights_high;  // corners 4 to 7
};

PL_STRUCT QueryResult {
  VEC3 irradiance;
  REAL weight_sum;
  int answer;  // PL_ANSWER_*
};

PL_NAMESPACE_END

#endif
