// SPDX-License-Identifier: Apache-2.0
// Whole files in and out. Writing goes to a temporary file beside the target and is renamed, so a
// reader never sees half a file and a failed run leaves nothing behind.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace probelab {

// False as well where the system cannot say: a name that is too long, a folder that is closed, a
// circle of links.
bool isFile(const std::filesystem::path& path);
bool isFolder(const std::filesystem::path& path);
// Without links and dots, as far as the system can follow it.
std::filesystem::path plainPath(const std::filesystem::path& path);

// Throw InputError naming the path when it is missing, a folder, or unreadable.
std::vector<std::byte> readFile(const std::filesystem::path& path);
std::string readTextFile(const std::filesystem::path& path);
// The same without the UTF-8 byte order mark that spreadsheets put first.
std::string readCsvFile(const std::filesystem::path& path);

// Writes through `write(temporary path)` and renames; a link stays, and its target is written. The
// folder must exist (checkWritable). Throws InputError where a device or a pipe would be replaced.
void writeFileAtomically(const std::filesystem::path& path,
                         const std::function<void(const std::filesystem::path&)>& write);
void writeTextFile(const std::filesystem::path& path, std::string_view text);

// Removes what writers that were killed have left in a folder: ".NAME.TAG.tmp.EXT" and
// ".NAME.TAG.out" with the tag of a process of this machine that is no more.
void removeLeftOvers(const std::filesystem::path& folder);
// "PROCESS-HOST": names files of one process apart from those of any other, also where machines
// share a folder.
std::string processTag();

// Throws InputError unless a file can be created at `path`: call it before hours of work.
void checkWritable(const std::filesystem::path& path);

}  // namespace probelab
