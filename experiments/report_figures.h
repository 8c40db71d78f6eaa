// SPDX-License-Identifier: GPL-3.0-or-later
// Finished figures for the report's page.
#pragma once

#include <filesystem>

#include "json.h"
#include "program.h"
#include "report_page.h"

namespace probelab {

// Every figure of the folder, by name: [{name, caption, type: media type, blob}]. A figure is
// <name>.svg or, without one, <name>.png; its caption is <name>.txt. A file that is not what its
// name says is noted and left out.
Json reportFigures(const std::filesystem::path& folder, ReportPage& page,
                   const Invocation& invocation);

}  // namespace probelab
