// SPDX-License-Identifier: Apache-2.0
#include "ddgi/snapshot.h"

namespace probelab {

FieldSnapshot takeSnapshot(ProbeField& field) {
  FieldSnapshot snapshot;
  snapshot.lattice = latticeShape(field.layout(), field.params());
  snapshot.modes = queryModes(field.params());
  snapshot.params = queryParams(field.params());
  snapshot.probe_of_point = field.layout().probe_of_point;
  snapshot.irradiance = field.irradianceTexels();
  snapshot.moments = field.momentTexels();
  return snapshot;
}

}  // namespace probelab
