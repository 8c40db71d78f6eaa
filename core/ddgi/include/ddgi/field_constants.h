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

// The query's modes and the atlases' formats. `moved`: probes are off the lattice's points.
Defines fieldDefines(const Params& params, bool moved);

}  // namespace probelab
