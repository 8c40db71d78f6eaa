// SPDX-License-Identifier: Apache-2.0
// The gate in front of every metric: array sizes, finite numbers, usable weights.
#pragma once

#include "metrics/error.h"

namespace probelab {

// Aborts where the arrays' sizes differ; otherwise throws as computeErrors documents.
void validateSamples(const ReceiverSamples& samples);

// Throws NumericalError naming array and index.
void requireFinite(std::span<const Vec3f> values, const char* name);

}  // namespace probelab
