// SPDX-License-Identifier: GPL-3.0-or-later
// The query with traced visibility in place of the moments': what no parameter of visibility can
// beat at these probes. Everything else (interpolation, facing, crush, fallback) is the shared
// query.
#pragma once

#include <span>
#include <vector>

#include "ddgi/snapshot.h"
#include "trace/embree_scene.h"

namespace probelab {

// Whether the segment from the point, off its surface on the normal's side, to the probe is free.
bool seesProbe(const EmbreeScene& embree, const QueryPoint& point, const Vec3f& probe);

// Irradiance at the points, [point]. A probe's visibility is 1 where seesProbe, else 0; with
// visibility off in `params` too. Where no probe of the cell is seen, the fallback answers as at
// run time (with crush before_trilinear, which leaves every probe some weight, their mean). Moments
// are not read. Parallel and deterministic. Throws InputError where `params` ask for what the field
// has not.
std::vector<Vec3f> queryExactVisibility(const FieldSnapshot& field, const Params& params,
                                        std::span<const QueryPoint> points,
                                        const EmbreeScene& embree);

}  // namespace probelab
