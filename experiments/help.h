// SPDX-License-Identifier: GPL-3.0-or-later
// The layout of the --help pages. Called by program.cpp through CLI11's formatter.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace probelab {

// The last group of every page; its options are the same for all commands.
inline constexpr const char* kCommonGroup = "Common options";

// The whole page of one command (or, with `full_name` "probelab", of the program), 80 columns wide.
std::string formatHelp(const CLI::App& app, const std::string& full_name);

}  // namespace probelab
