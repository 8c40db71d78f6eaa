// SPDX-License-Identifier: Apache-2.0
// The directions of an update's rays.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/vec.h"

namespace probelab {

// Spherical Fibonacci points [M19]: phi_i = 2 pi frac(i (golden - 1)), cos theta_i = 1 - (2i+1)/n.
// Unit vectors, rounded from double.
std::vector<Vec3d> sphericalFibonacci(int n);

// A rotation matrix (rows) that is uniform over all rotations, a function of (seed, update) alone
// (Shoemake 1992, uniform quaternions).
std::array<Vec3d, 3> randomRotation(uint64_t seed, uint64_t update);

// The n directions of update number `update`.
std::vector<Vec3f> updateDirections(int n, uint64_t seed, uint64_t update);

}  // namespace probelab
