// SPDX-License-Identifier: GPL-3.0-or-later
// TUNED.toml: parameters with where they come from.
#pragma once

#include <string>

#include "tune_report.h"

namespace probelab {

// A preset and what differs from it, for --params; every tuned key with its unit and what it was.
// Nothing in it depends on the clock, on where it is written or on how much was reported.
std::string formatTunedFile(const TuneOutcome& outcome, const std::string& from);

// The command without what changes no number: outputs, --json, --quiet, --cache, --threads.
std::string reproducibleCommand(const std::string& command_line);

}  // namespace probelab
