// SPDX-License-Identifier: Apache-2.0
// What receivers.cpp and receivers_io.cpp share.
#pragma once

#include "trace/receivers.h"

namespace probelab {

// Weights, region, view, split and provenance of points whose position and normal a person gave.
void placePoints(Receivers& receivers, const Scene& scene, const EmbreeScene& embree,
                 const Reachability& reachability);

}  // namespace probelab
