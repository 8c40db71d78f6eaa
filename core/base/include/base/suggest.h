// SPDX-License-Identifier: Apache-2.0
// The nearest known name, for messages about unknown keys and names.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace probelab {

// The candidate with the smallest edit distance to `name`; empty when none is close enough to be
// what was meant (more than half of the name would have to change).
std::string nearestName(std::string_view name, std::span<const std::string> candidates);

// ", did you mean 'x'?" or, when nothing is close, ", known are: a, b, c".
std::string suggestion(std::string_view name, std::span<const std::string> candidates);

}  // namespace probelab
