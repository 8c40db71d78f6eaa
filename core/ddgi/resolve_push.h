// SPDX-License-Identifier: Apache-2.0
// Push constants of resolve.comp.glsl.
#pragma once

#include "ddgi/constants.h"

namespace probelab {

struct ResolvePush {
  uint32_t item_count;
  float radiance_clamp;  // nit
  FieldAddresses field;
  uint64_t surfaces, rays;
};

}  // namespace probelab
