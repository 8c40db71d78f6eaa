// SPDX-License-Identifier: Apache-2.0
#include "ddgi/snapshot.h"

namespace probelab {

FieldSnapshot layoutSnapshot(const ProbeLayout& layout, const ProbeStates& states,
                             const Params& params) {
  FieldSnapshot snapshot;
  snapshot.lattice = latticeShape(layout, params);
  snapshot.modes = queryModes(params);
  snapshot.params = queryParams(params);
  snapshot.interpolant = queryInterpolant(layout);
  snapshot.positions = states.positions;
  const bool nearest = snapshot.modes.fallback == PL_FALLBACK_NEAREST;
  if (snapshot.interpolant == PL_INTERPOLANT_SCATTERED) {
    snapshot.influence = activeInfluence(layout.influence, states.positions, states.active);
    if (nearest) snapshot.nearest_probe = snapshot.influence.nearest;
    snapshot.modes.walls = snapshot.influence.pieces.planes.empty() ? 0 : 1;
    for (const ProbeLengths& lengths : layout.lengths)
      snapshot.bias_lengths.push_back(lengths.bias);
    return snapshot;
  }
  snapshot.modes.moved = isMoved(layout, states) ? 1 : 0;
  snapshot.probe_of_point = activeIndex(layout, states);
  if (nearest) snapshot.nearest_probe = nearestIndex(layout, states);
  return snapshot;
}

FieldSnapshot takeSnapshot(ProbeField& field) {
  FieldSnapshot snapshot = layoutSnapshot(field.layout(), field.states(), field.params());
  snapshot.irradiance = field.irradianceTexels();
  snapshot.moments = field.momentTexels();
  return snapshot;
}

}  // namespace probelab
