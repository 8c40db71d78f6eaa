// SPDX-License-Identifier: GPL-3.0-or-later
#include "field_view.h"

#include "base/error.h"

namespace probelab {

QueryModes viewModes(const FieldSnapshot& field, const Params& params) {
  QueryModes modes = queryModes(params);
  modes.moved = field.modes.moved;
  modes.walls = field.modes.walls;
  if (modes.fallback == PL_FALLBACK_NEAREST && field.nearest_probe.empty())
    throwInput(
        "{}: the field was run without fallback = \"nearest\", so it has no index of nearest "
        "probes; run it with that, or set another fallback",
        params.name);
  const AtlasSides sides = atlasSides(params);
  if (sides.irradiance != field.lattice.irradiance_texels || sides.border != field.lattice.border)
    throwInput("{}: irradiance_texels and border must be those that the field was run with",
               params.name);
  return modes;
}

}  // namespace probelab
