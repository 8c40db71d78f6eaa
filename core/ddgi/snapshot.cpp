// SPDX-License-Identifier: Apache-2.0
#include "ddgi/snapshot.h"

namespace probelab {

FieldSnapshot takeSnapshot(ProbeField& field) {
  FieldSnapshot snapshot;
  snapshot.lattice = latticeShape(field.layout(), field.params());
  snapshot.modes = queryModes(field.params());
  snapshot.params = queryParams(field.params());
  snapshot.modes.moved = isMoved(field.layout(), field.states()) ? 1 : 0;
  snapshot.probe_of_point = activeIndex(field.layout(), field.states());
  if (snapshot.modes.fallback == PL_FALLBACK_NEAREST)
    snapshot.nearest_probe = nearestIndex(field.layout(), field.states());
  snapshot.positions = field.states().positions;
  snapshot.irradiance = field.irradianceTexels();
  snapshot.moments = field.momentTexels();
  return snapshot;
}

}  // namespace probelab
