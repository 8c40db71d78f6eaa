// SPDX-License-Identifier: Apache-2.0
// Conservative voxelization: which cells of a grid a triangle touches.
#pragma once

#include <array>
#include <functional>

#include "base/vec.h"

namespace probelab {

// Separating axes of a triangle and an axis-aligned box (Akenine-Möller, Fast 3D Triangle-Box
// Overlap Testing, 2001), in double, closed sets.
bool overlaps(const std::array<Vec3d, 3>& triangle, const Box3d& box);

// Calls `visit` with the coordinates of every cell that the triangle touches; cells are closed and
// grown by 1e-6 of their size, so that a wall on a cell's face belongs to both sides.
void visitCells(const std::array<Vec3d, 3>& triangle, const Box3d& bounds, const Vec3i& resolution,
                const std::function<void(const Vec3i&)>& visit);

}  // namespace probelab
