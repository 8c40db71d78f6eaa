// SPDX-License-Identifier: GPL-3.0-or-later
#include "json.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace probelab {

Json optionalNumber(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

void printJson(const Json& json) { fmt::print("{}\n", json.dump(2)); }

}  // namespace probelab
