// SPDX-License-Identifier: GPL-3.0-or-later
// The numbers of a command's JSON under flat names, as the tables of studies have them.
#pragma once

#include <functional>
#include <string>

#include "json.h"

namespace probelab {

// Visits numbers and truth values under `json` by their dotted names. Entries of a list go by the
// name that they have ("rungs.exact.nrmse", "parameters.normal_bias.tuned"); lists whose entries
// have none or the same, and errors by block, are left out.
void visitNumbers(const Json& json,
                  const std::function<void(const std::string& name, const Json& value)>& visit);

}  // namespace probelab
