// SPDX-License-Identifier: GPL-3.0-or-later
// Maximum-entropy weights (Arroyo and Ortiz, Local maximum-entropy approximation schemes, IJNME 65,
// 2006): of all non-negative weights whose centroid is the place, those nearest to a prior kernel.
// They reproduce linear functions inside the hull of the points; on a lattice the sharp kernel's
// are the trilinear ones. Outside the hull the centroid comes as near as a stiffness allows.
#pragma once

#include <span>

#include "base/vec.h"

namespace probelab {

// The kernel (1 - q)^2 exp(-sharpness q^2), q = distance / support: 0 at the support.
float maxentPrior(float q, float sharpness);

// offsets: from the place to the points, over the support; priors positive for at least one.
// Fills `shares`, sum 1. Of more than 64 points only the first 64 count.
void maxentShares(std::span<const Vec3f> offsets, std::span<const float> priors,
                  std::span<float> shares);

// Where no more than k points are known, the support over the farthest one's distance.
inline constexpr float kOpenSupport = 2;

}  // namespace probelab
