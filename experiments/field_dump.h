// SPDX-License-Identifier: GPL-3.0-or-later
// --dump-field: a field as files that other programs read.
#pragma once

#include <filesystem>

#include "ddgi/probe_field.h"
#include "provenance.h"
#include "scene/scene.h"

namespace probelab {

// Throws InputError unless `folder` exists and files can be made in it.
void checkDumpFolder(const std::filesystem::path& folder);

// irradiance.exr: mean radiance times pi (linear, decoded) in R, G, B, one row of texels after the
// other, a probe's map of side x side texels (border included) below the one before it;
// moments.exr: mean and mean square of the distance in units of r_i in channels X and Y, laid out
// alike; probes.csv: index, world position; params.toml.
void dumpField(const std::filesystem::path& folder, const Scene& scene, ProbeField& field,
               const Provenance& provenance);

}  // namespace probelab
