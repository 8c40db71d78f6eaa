// SPDX-License-Identifier: GPL-3.0-or-later
// Ablations as data: rows of settings, each a change to what the command line says. TOML files,
// with
//
//   about = "what the table is for"
//   [[row]]
//   name = "no visibility"
//   about = "what to look for"         # may be left out, like every key below
//   set = ["visibility=false"]         # in this order, over --params, --rays and --set
//   else_set = ["fallback=none"]       # instead of set, where the parameters do not allow that
//   params = "rtxgi"                   # a preset or file instead of --params and --set
//   ray_proxy = 0.01                   # metres
//   vertical = 2.0                     # spacing along y over that along x and z
//   probes = 0.5                       # x --probes
//   clamp_over_mean = 8.0              # radiance_clamp in units of mean irradiance / pi
//   mode = "temporal"                  # the row counts in this mode only
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ddgi/params.h"
#include "field_options.h"

namespace probelab {

struct AblationRow {
  std::string name, about;
  std::vector<std::string> set, else_set;
  std::string params;  // empty: as the command line says
  std::optional<double> ray_proxy, vertical, probes, clamp_over_mean;
  std::string mode;   // empty: any
  std::string where;  // "file:line", for messages
};

struct Ablation {
  std::string name, about;
  std::vector<AblationRow> rows;
};

std::vector<std::string> ablationNames();

// A built-in name or a TOML file. Throws InputError with file, line and the nearest known name.
Ablation loadAblation(const std::string& name_or_file);

// A row applied to the command line. `why_not` says why there is nothing to measure, else is empty.
struct AblationCase {
  AblationRow row;
  FieldOptions options;
  Params params;
  std::string why_not;
};

// The base ("base", the command line itself) and then every row. Throws InputError where a row
// cannot be applied: an unknown key, a value out of range, an impossible combination.
std::vector<AblationCase> resolveAblation(const Ablation& ablation, const FieldOptions& base);

}  // namespace probelab
