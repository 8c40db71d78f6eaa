// SPDX-License-Identifier: GPL-3.0-or-later
// What a file is, for keys of results that were made from it.
#pragma once

#include <filesystem>
#include <string>

namespace probelab {

// Hash of a file's bytes and, of a glTF or GLB, of the buffers beside it that it names. Throws
// InputError where the file itself cannot be read.
std::string inputIdentity(const std::filesystem::path& path);

}  // namespace probelab
