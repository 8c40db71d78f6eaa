// SPDX-License-Identifier: GPL-3.0-or-later
// The nearest probes that a place sees.
#pragma once

#include <vector>

#include "ddgi/influence.h"
#include "placement/free_space.h"
#include "placement/nearest_probes.h"

namespace probelab {

// Of the scene's extent: a place as near to a surface as this lies on it.
inline constexpr float kOnSurface = 2e-6f;

// Whether a probe sees a place, which may lie on a surface: what is nearer to the place than
// kOnSurface does not count, nor the 1e-4 of the way before the probe.
bool seesPlace(const EmbreeScene& embree, const Vec3f& probe, const Vec3f& place);

// The `count` nearest probes that the place sees, of the 256 nearest, nearest first; if it sees
// none, the nearest ones regardless. Without `visibility` it sees all.
void visibleProbes(const NearestProbes& probes, const std::vector<Vec3f>& positions,
                   const FreeSpace& space, const Vec3f& place, std::size_t count, bool visibility,
                   std::vector<NearProbe>& visible);

// (1 - d / r)^2 for the first k of them; see nearestWeights.
std::vector<CornerWeight> kernelWeights(const std::vector<NearProbe>& visible, std::size_t k);

// Maximum-entropy weights (placement/maxent.h) of the first k of them at a place. Those whose share
// is not above the cutoff go, and the others are weighed anew, so that their centroid stays.
std::vector<CornerWeight> maxentWeights(const std::vector<NearProbe>& visible, std::size_t k,
                                        const std::vector<Vec3f>& positions, const Vec3f& place,
                                        double sharpness, double cutoff);

}  // namespace probelab
