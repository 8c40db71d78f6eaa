// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab stability --curves`: where precision goes, as JSON and as a table.
#pragma once

#include <string>

#include "json.h"
#include "program.h"

namespace probelab {

// {"curves": [{"id", "tracer", "curve", "axis", "measure", "bound", "breaks_below",
// "breaks_above", "points": [{"x", "error"}], "seconds"}], "device", "version", "provenance"};
// `name` as of --case, `tracer`: embree, rayquery or both.
Json runPrecision(const std::string& name, const std::string& tracer,
                  const Invocation& invocation);

void printPrecision(const Json& result);

}  // namespace probelab
