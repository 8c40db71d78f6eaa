// SPDX-License-Identifier: GPL-3.0-or-later
// Probes as a GLB for modellers: an octahedron a probe, a tenth of its bias length in radius,
// coloured by state. Strategy `file` reads it back.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "ddgi/layout.h"
#include "scene/scene.h"

namespace probelab {

// Nodes "probe <index>" at world positions, each with one of three meshes ("active probe",
// "pinned probe", "inactive probe"); pinned ones carry `"extras": {"pinned": true}`. `active` is
// [probe], or empty: all are.
void writeProbesGlb(const std::filesystem::path& path, const ProbeLayout& layout,
                    const Scene& scene, const std::vector<uint8_t>& active);

// Whether writeProbesGlb wrote the file at `path`, by the generator that its glTF asset names.
bool isProbesGlb(const std::filesystem::path& path);

}  // namespace probelab
