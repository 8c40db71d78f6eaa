// SPDX-License-Identifier: GPL-3.0-or-later
// Moves, adds and swaps probes of a SubsetModel as long as its cost falls. Many proposals are tried
// at once against the same state; of those that help, the best that do not touch each other's
// receivers are taken, so the result does not depend on the number of threads.
#pragma once

#include <cstdint>
#include <functional>

#include "placement/distance.h"
#include "placement/free_space.h"
#include "placement/subset_model.h"

namespace probelab {

struct SearchSettings {
  int probes = 0;                // at most that many in the end
  double proposals_a_probe = 0;  // in all, times the budget
  double swap_share = 0;         // of the proposals; the others are moves
  float spacing_m = 0;
  float wall_gap_m = 0;  // kept off surfaces; a quarter of the room between two where it is less
};

// The number of proposals that were tried. `progress` gets the share done. Throws Interrupted.
uint64_t searchPositions(SubsetModel& model, const Training::Data& data, const BakePlan& plan,
                         const FreeSpace& space, const SceneDistance& distance,
                         const SearchSettings& settings, uint64_t seed,
                         const std::function<void(double)>& progress = {});

}  // namespace probelab
