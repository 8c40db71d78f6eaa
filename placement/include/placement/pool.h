// SPDX-License-Identifier: GPL-3.0-or-later
// Candidates that a set of probes should make superfluous: places of all of the free space, most of
// them before a wall, and of each what a probe there would say in one direction, the wall's own:
// what is right there is what a query at the wall should say. It is gathered over the hemisphere as
// at receivers, since the rays of a whole probe are too few for a small light. They read no
// receiver: train receivers lie in half of the blocks of space only, and a set that is judged by
// them alone leaves the other half to chance.
#pragma once

#include "placement/subset_model.h"

namespace probelab {

struct PoolSettings {
  int points = 0;
  double share = 0;     // of the cost's weight; the train receivers keep the rest
  float spacing_m = 0;  // of the layout to be
};

void addPool(JudgedPoints& judged, const Training::Data& data, const PoolSettings& settings,
             uint64_t seed);

}  // namespace probelab
