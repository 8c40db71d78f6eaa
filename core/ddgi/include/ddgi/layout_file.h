// SPDX-License-Identifier: Apache-2.0
// Layout files: JSON with everything a query needs and where it came from. Positions in world
// coordinates.
#pragma once

#include <filesystem>
#include <string>

#include "ddgi/layout.h"
#include "scene/scene.h"

namespace probelab {

// Of the origin, the vertex positions and the triangles: what a layout stands on. The same under
// all lighting.
std::string geometryHash(const Scene& scene);

// Written by rename. The file names the scene (path and content hash), the program's version, the
// strategy with its options, budget and seed.
void writeLayout(const std::filesystem::path& path, const ProbeLayout& layout, const Scene& scene);

// Reads back the same layout, bit for bit in every position, length and weight. Throws InputError
// naming file and element for a wrong name, type, size or index, a number that is not finite, or a
// layout made for another geometry or [volume].
ProbeLayout readLayout(const std::filesystem::path& path, const Scene& scene);

}  // namespace probelab
