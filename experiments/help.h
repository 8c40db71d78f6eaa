// SPDX-License-Identifier: GPL-3.0-or-later
// The layout of the --help pages. Called by program.cpp through CLI11's formatter.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace CLI {
class App;
}

namespace probelab {

// The last group of every page; its options are the same for all commands.
inline constexpr const char* kCommonGroup = "Common options";

// The whole page of one command (or, with `full_name` "probelab", of the program), 80 columns wide.
std::string formatHelp(const CLI::App& app, const std::string& full_name);

// A part of a page in its layout: a title and rows of a name with its text.
std::string formatHelpPart(const std::string& title,
                           const std::vector<std::pair<std::string, std::string>>& rows);

}  // namespace probelab
