// SPDX-License-Identifier: GPL-3.0-or-later
// What probes that lie on no lattice weigh at the corners of a grid of voxels (ddgi/influence.h):
// four interpolants. None of them looks at light.
#pragma once

#include <cstdint>
#include <vector>

#include "ddgi/influence.h"
#include "placement/free_space.h"
#include "placement/nearest_probes.h"
#include "placement/wall_pieces.h"

namespace probelab {

// What the corner grid spans: the reachable free space alone, less a little of the spacing at its
// walls. Places beyond are answered by the nearest voxel, and a volume may be far larger.
Box3f influenceBox(const PlacementInput& input, double spacing_m);

// A corner grid over a box: cells of about spacing / cells_per_spacing, at least 3 corners an axis
// and at most 2 M in all.
Lattice influenceCorners(const Box3f& box, double spacing_m, double cells_per_spacing = 2);

struct CornerSettings {
  int k = 8;               // probes a corner
  bool visibility = true;  // only probes that the corner sees
  double sharpness = 0;  // above 0: maximum-entropy weights (placement/maxent.h), not the kernel's
  double cutoff = 0.05;  // smaller shares are left out, with maximum entropy
};

// The places that stand for a corner: itself if it is usable, else the usable ones among the
// middles of the eight octants around it, half-way to the voxels' middles: a corner in a wall
// serves the voxels on both sides. Empty where there is no free space near it.
std::vector<Vec3f> viewpoints(const Lattice& corners, std::size_t corner, const FreeSpace& space);

// At each corner the k nearest visible probes with (1 - d / r)^2, r the distance of the (k+1)-th
// visible one: so a weight has fallen to 0 when its probe leaves the set, and moving over the
// corners the set changes without a jump. Where no more than k are visible (a small room, a small
// N) none ever leaves by distance, and r is twice the farthest one's. A place that sees none of the
// 256 nearest probes takes the nearest ones regardless. Of several viewpoints the mean counts;
// corners without one are left empty. With a `sharpness` the k weigh by maximum entropy instead.
CornerWeights nearestWeights(const Lattice& corners, const std::vector<Vec3f>& positions,
                         const FreeSpace& space, const CornerSettings& settings);

// The same for one corner with these viewpoints.
std::vector<CornerWeight> nearestFrom(const NearestProbes& probes, const std::vector<Vec3f>& positions,
                                  const FreeSpace& space, const std::vector<Vec3f>& from,
                                  const CornerSettings& settings);

// Weights of every list of `pieces`: those of its corner where nothing but the corner stands for it,
// else those of nearestFrom its viewpoints.
CornerWeights pieceWeights(const WallPieces& pieces, const Lattice& corners, CornerWeights weights,
                           const std::vector<Vec3f>& positions, const FreeSpace& space,
                           const CornerSettings& settings);

// Barycentric in the Delaunay tetrahedron around the corner; outside the hull, those of the
// closest point on it. Coplanar probes are triangulated, collinear ones chained; coinciding ones
// share. With `visibility` hidden vertices are dropped; a corner that loses all takes its knn
// weights. Part of builds with CGAL.
CornerWeights tetrahedraWeights(const Lattice& corners, const std::vector<Vec3f>& positions,
                                const FreeSpace& space, const CornerSettings& settings);

// Natural neighbours (Sibson 1981), by counting (Park et al., Discrete Sibson Interpolation, IEEE
// TVCG 12(2), 2006): each sample of free space that lies nearer to the corner than to the nearest
// probe that it sees counts for that probe: the volume that the corner would take from it. With
// `visibility` a sample counts only at corners that it sees. There are 8 samples a mean spacing
// along every axis. Corners at a probe, where there is nothing to take, have that probe alone;
// corners that are not usable themselves their knn weights.
CornerWeights naturalWeights(const Lattice& corners, const std::vector<Vec3f>& positions,
                             const FreeSpace& space, const CornerSettings& settings);

}  // namespace probelab
