// SPDX-License-Identifier: GPL-3.0-or-later
// The stronger lattices: swept, sparse, and moved by geometry.
#pragma once

#include <functional>

#include "placement/grid.h"

namespace probelab {

extern const Strategy kGridBestStrategy;
extern const Strategy kGridSparseStrategy;
#ifdef PROBELAB_WITH_CGAL
extern const Strategy kRelocatedStrategy;
#endif

class SceneDistance;

// What a lattice's layout becomes before it is scored and returned; empty: itself.
using LayoutFinish = std::function<ProbeLayout(const ProbeLayout&)>;

// The best of 20 to 40 lattices by Training::score: every box of likelyBoxes with flat, cubic
// and tall cells, then other counts in the best box, then the best counts in every box.
ProbeLayout bestLattice(const PlacementInput& input, const LayoutFinish& finish = {});

// A lattice in the box, moved by `offset` of its spacing along every axis, whose usable points are
// at most N and as near to N as a search over its counts comes.
Lattice sparseLattice(const PlacementInput& input, const LatticeBox& box, double vertical,
                      double offset = 0);

#ifdef PROBELAB_WITH_CGAL
// A lattice's layout with its probes moved as `relocated` moves them unless it is told otherwise.
ProbeLayout relocatedLattice(const PlacementInput& input, const SceneDistance& distance,
                             const ProbeLayout& base);
#endif

// The sparse lattice in the default box, or the best over boxes and cells by Training::score.
ProbeLayout bestSparseLattice(const PlacementInput& input, bool sweep,
                              const LayoutFinish& finish = {}, double offset = 0);

}  // namespace probelab
