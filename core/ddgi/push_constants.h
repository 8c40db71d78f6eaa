// SPDX-License-Identifier: Apache-2.0
// Push constants of stages that more than one file runs.
#pragma once

#include "ddgi/constants.h"
#include "ddgi/ray_batch.h"

namespace probelab {

struct GeneratePush {  // generate.comp.glsl
  uint32_t item_count;
  RayItems items;
  uint32_t unused;
  uint64_t rays;
};

struct ResolvePush {  // resolve.comp.glsl
  uint32_t item_count;
  float radiance_clamp;  // nit
  FieldAddresses field;
  uint64_t surfaces, rays, radiance, distances, hit_irradiance;
};

// `hit_irradiance`: a camera's buffer for it.
inline ResolvePush makeResolvePush(uint32_t count, double radiance_clamp,
                                   const FieldAddresses& field, const RayBuffers& rays,
                                   uint64_t hit_irradiance = 0) {
  return {count,
          static_cast<float>(radiance_clamp),
          field,
          rays.surfaces.address(),
          rays.rays.address(),
          rays.radiance.address(),
          rays.distances.address(),
          hit_irradiance};
}

}  // namespace probelab
