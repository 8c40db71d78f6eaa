// SPDX-License-Identifier: GPL-3.0-or-later
// Barycentric weights in the Delaunay tetrahedra of points (CGAL). Part of builds with CGAL.
#pragma once

#include <vector>

#include "ddgi/influence.h"

namespace probelab {

// At each corner the weights of the tetrahedron around it, or of the hull's closest point. Not
// negative, sum 1. Coplanar positions are triangulated, collinear ones chained; coinciding ones
// share. `positions` must not be empty.
CornerWeights barycentricWeights(const Lattice& corners, const std::vector<Vec3f>& positions);

}  // namespace probelab
