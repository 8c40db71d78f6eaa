// SPDX-License-Identifier: GPL-3.0-or-later
// The JSON of results: members stay in the order in which they are written.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>

namespace probelab {

using Json = nlohmann::ordered_json;

// A number, or null where there is none.
Json optionalNumber(const std::optional<double>& value);

// Prints one object on stdout.
void printJson(const Json& json);

}  // namespace probelab
