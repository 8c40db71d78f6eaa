// SPDX-License-Identifier: GPL-3.0-or-later
// Where the limits were: experiments/stability/limits/*.json, a file a device, built into the
// program; its name is what the device's name begins with.
#pragma once

#include <map>
#include <span>
#include <string>

#include "base/embedded_file.h"
#include "stability/suite.h"

namespace probelab {

std::span<const EmbeddedFile> limitFiles();

using RecordedLimits = std::map<std::string, double>;  // by the row's id

// Empty for a device without a file.
RecordedLimits recordedLimits(const std::string& device);

// A row that is a limit fails where it ends more than 20 % off the recorded point, or where none is
// recorded, though others of this device are. Without any record it is what was measured.
Measurement againstRecord(const Measurement& measured, const std::string& id,
                          const RecordedLimits& recorded);

}  // namespace probelab
