// SPDX-License-Identifier: Apache-2.0
// What the textbook stages are told by push constants, in scalar layout; compiled by C++ and GLSL.
#ifndef PROBELAB_TEXTBOOK_CONSTANTS_H
#define PROBELAB_TEXTBOOK_CONSTANTS_H

#include "shared/ray.h"

PL_NAMESPACE_BEGIN

struct TextbookBlend {
  PL_UINT first_probe;  // of the dispatch: workgroup 0
  PL_UINT count_x;      // of the lattice
  PL_UINT count_y;
  float hysteresis;
  float encode_exponent;       // 1 / gamma
  float irradiance_threshold;  // in stored units
  float brightness_threshold;
  float smallest_step;         // while a texel darkens
  PL_UINT backface_limit;      // so many rays on back faces leave the irradiance as it is
  float distance_exponent;
  float largest_distance;      // metres
};

struct TextbookQuery {
  PL_FLOAT3 first;  // position of probe (0, 0, 0)
  PL_UINT point_count;
  PL_FLOAT3 spacing;
  float normal_bias;  // metres
  PL_UINT count_x;
  PL_UINT count_y;
  PL_UINT count_z;
  float view_bias;  // metres
  float decode_exponent;  // gamma / 2
};

PL_NAMESPACE_END

#endif
