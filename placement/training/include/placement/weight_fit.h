// SPDX-License-Identifier: GPL-3.0-or-later
// Interpolation weights fitted to what is right at the judged points, under all states at once.
// Which probes answer well at a place depends on geometry, not on the light, so weights that hold
// under many lights hold under others.
#pragma once

#include "ddgi/layout.h"
#include "placement/subset_model.h"

namespace probelab {

// The weights at a grid's corners, in its units; of a grid without walls.
CornerWeights cornerWeights(const InfluenceGrid& grid);

struct FitSettings {
  int iterations = 0;
  double stiffness = 0;  // pull towards the given weights, over the cost at the start
};

// Corner weights w exp(t): the t minimise the objective's cost of the layout's query on baked
// probes plus stiffness times the cost at the start times the mean of t^2 over all weights. Weights
// stay positive and no probe comes or goes; a point that costs more than ten times the mean of the
// others at the start weighs no more than that. `layout` gives positions, lengths and the corner
// grid, `pieces` which of the weights count where.
CornerWeights fitWeights(const Training::Data& data, const JudgedPoints& judged,
                         const ProbeLayout& layout, CornerWeights weights,
                         const VoxelPieces& pieces, const Params& params,
                         const Objective& objective, const FitSettings& settings);

}  // namespace probelab
