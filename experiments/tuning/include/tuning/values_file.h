// SPDX-License-Identifier: GPL-3.0-or-later
// Fitted texel values as gains that go on top of a field that has been run: JSON files that belong
// to one set of probes.
//
//   field run -> fitValues -> makeValues -> writeValues
//   field run again -> readValues -> applyValues
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "ddgi/probe_field.h"
#include "trace/receivers.h"

namespace probelab {

struct TexelValues {
  std::string scene, state;  // that they were fitted in
  std::string params;        // name of the parameters that they were fitted for
  std::string probes_hash;   // probesHash
  int texels = 0;            // interior, a side
  std::vector<Vec3f> gains;  // of irradiance, [probe][y][x], interior texels
};

// Of everything that says which texel lies where and what reads it: interpolant, lattice, positions
// (where relocation has moved them to), influence, which probes are active, texels a side.
std::string probesHash(const ProbeLayout& layout, const ProbeStates& states, const Params& params);

// Gains from traced to fitted texels (both as ProbeField::irradianceTexels); 1 where the traced one
// is 0. `receivers` name scene and state.
TexelValues makeValues(const ProbeField& field, const Receivers& receivers,
                       std::span<const Vec3f> traced, std::span<const Vec3f> fitted);

// Written by rename.
void writeValues(const std::filesystem::path& path, const TexelValues& values);

// Reads back the same gains, bit for bit. Throws InputError naming file and element for a wrong
// name, type, size or number.
TexelValues readValues(const std::filesystem::path& path);

// Throws InputError, naming the file, unless the values belong to these probes.
void checkValues(const TexelValues& values, const ProbeField& field, const std::string& file);

// Stored texels with the gains on them, borders included.
std::vector<Vec3f> texelsWithGains(const TexelValues& values, const Params& params,
                                   std::vector<Vec3f> stored);

// Multiplies the field's texels as they are now; call it after the last update, once.
void applyValues(ProbeField& field, const TexelValues& values);

}  // namespace probelab
