// SPDX-License-Identifier: Apache-2.0
// What every stage that queries a field is told of it.
#pragma once

#include "ddgi/constants.h"
#include "ddgi/layout.h"
#include "ddgi/params.h"
#include "ddgi/stage.h"

namespace probelab {

// LatticeShape, QueryParams and DistanceRule as field.glsl declares them.
GpuBuffer uploadFieldConstants(GpuContext& context, const ProbeLayout& layout,
                               const Params& params);

// What of a layout the query has to be told.
struct LayoutUse {
  bool moved = false;  // probes are off the lattice's points: positions are fetched
  bool full = false;   // every lattice point has its active probe: no index is fetched
  bool walls = false;  // walls divide voxels of scattered probes
  int interpolant = PL_INTERPOLANT_LATTICE;
};

// The query's modes and the atlases' formats, as stages are specialised to them.
Defines fieldDefines(const Params& params, const LayoutUse& use);

// The same for resolve.comp.glsl: rays of probes, or of a camera, which wants the irradiance at the
// hit, always the bounce and never a clamp.
enum class RayUse { probes, camera };
Defines resolveDefines(const Params& params, const LayoutUse& layout, RayUse rays);

}  // namespace probelab
