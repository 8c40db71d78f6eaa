// SPDX-License-Identifier: GPL-3.0-or-later
// Probe positions from files that people write: GLB and glTF from a modeller, CSV.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/vec.h"

namespace probelab {

struct FilePoints {
  std::vector<Vec3d> world;     // positions
  std::vector<uint8_t> pinned;  // 1: pinned; as long as `world`
};

// x,y,z[,pinned] in world coordinates, pinned 0 or 1, after an optional header; empty lines and
// lines that start with # are skipped. Throws InputError naming file and line.
FilePoints readCsvPoints(const std::filesystem::path& path);

// Of the default scene: the origins of nodes whose name starts with "probe", pinned where their
// extras say "pinned": true, then the vertices of meshes of POINTS. Buffers are read from the GLB
// itself, a data URI or a file in the same folder. Throws InputError naming file and element.
FilePoints readGltfPoints(const std::filesystem::path& path);

}  // namespace probelab
