// SPDX-License-Identifier: GPL-3.0-or-later
// The studies of a folder as tables for the report's page. One object a study:
//
//   name, folder
//   provenance  [[what, value]]: every version, device and driver there is, with the count of its
//               cells where they differ
//   columns     [{name, label, unit, about, kind: "axis" | "number", main}]
//   rows        [{id, values: [one a column: text, number, bool or null], command}]
//   failures    [{id, error}]: results that cannot be read, and logs without a result
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "json.h"

namespace probelab {

// Studies are `folder` itself (folder/cells) or the folders in it, by name; an empty array where
// there is none. Throws InputError where a folder cannot be read.
Json reportStudies(const std::filesystem::path& folder);

// The files of a folder with one of the extensions (".png"), by name; none where there is no
// folder.
std::vector<std::filesystem::path> filesIn(const std::filesystem::path& folder,
                                           const std::vector<std::string>& extensions);
// The folders of a folder, by name.
std::vector<std::filesystem::path> foldersIn(const std::filesystem::path& folder);

}  // namespace probelab
