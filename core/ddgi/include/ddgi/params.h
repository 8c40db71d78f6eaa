// SPDX-License-Identifier: Apache-2.0
// Everything about a field that can be tuned. param_keys.cpp holds the one table of keys with
// units, ranges and advice; presets are TOML files under core/ddgi/presets, built into the library.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "shared/atlas_format.h"
#include "shared/query_params.h"

namespace probelab {

struct Params {
  std::string name;  // the preset's or the file's, then " key=value" for every later change
  // Rays.
  int rays = 0;  // a probe and update
  int ray_order = 0, feedback = 0;
  double radiance_clamp = 0, texture_footprint = 0;
  double flat_ray_share = 0, flat_contrast = 0, flat_brightness = 0;
  // Irradiance texels.
  int irradiance_texels = 0, irradiance_format = 0;  // a side, with the border; PL_FORMAT_*
  double encoding_gamma = 0;
  int irradiance_fit = 0, backface_skip = 0;
  double backface_freeze = 0;
  // Moment texels.
  int moment_texels = 0, moment_format = 0, moment_encoding = 0;
  double distance_exponent = 0;
  double distance_clamp = 0;       // x r_i
  double backface_shortening = 0;  // factor on the distance of a back face
  // Both atlases.
  int border = 0, rounding = 0;
  // Hysteresis.
  double hysteresis = 0;
  int warm_up = 0;  // updates
  int hysteresis_space = 0, change_detector = 0;
  double change_threshold = 0, change_drop = 0, reset_threshold = 0;
  double brightness_threshold = 0, darkening_step = 0;
  double variability_threshold = 0;
  // Probe states.
  int relocation = 0, relocation_iterations = 0;
  double relocation_limit = 0, relocation_front = 0;
  int classification = 0, fixed_rays = 0, offset_weights = 0;
  double backface_threshold = 0;
  // Query.
  int visibility = 0, facing = 0, trilinear = 0, crush = 0, average = 0, fallback = 0;
  double normal_bias = 0, view_bias = 0;  // x s_i
  double facing_offset = 0, trilinear_floor = 0;
  double chebyshev_power = 0, visibility_floor = 0, variance_bias = 0;
  double crush_threshold = 0;
  double parallax = 0;
};

// One key as help and error messages show it.
struct ParamInfo {
  std::string key, unit;
  std::string range;   // "0 .. 1" or the names a choice takes
  std::string advice;  // one line: when to change it
};
std::vector<ParamInfo> paramTable();

std::vector<std::string> presetNames();

// A preset's name or a TOML file (its keys over those of its `preset` key, which it must have
// unless it sets every key). Throws InputError with file, line and the nearest known name.
Params loadParams(const std::string& preset_or_file);

// "key=value"; the value in TOML's syntax, quotes around names optional.
void setParam(Params& params, const std::string& assignment);

// Every key with its value, as a TOML file that loads again.
std::string describeParams(const Params& params);

// Throws InputError when a combination is impossible (a value out of its range is refused earlier).
void validateParams(const Params& params);

QueryModes queryModes(const Params& params);
QueryParams<double> queryParams(const Params& params);
template <class T>
QueryParams<T> convertQueryParams(const QueryParams<double>& p) {
  return {T(p.normal_bias),     T(p.view_bias),        T(p.facing_offset), T(p.trilinear_floor),
          T(p.chebyshev_power), T(p.visibility_floor), T(p.variance_bias), T(p.variance_floor),
          T(p.crush_threshold), T(p.decode_exponent),  T(p.parallax)};
}

// Interior texels a side of the two atlases, and the sides as stored.
struct AtlasSides {
  int irradiance = 0, moments = 0;
  int border = 0;  // texels around the interior
  int stored(int interior) const { return interior + 2 * border; }
};
AtlasSides atlasSides(const Params& params);

// Bytes of atlas texels a probe owns, borders included.
uint64_t atlasBytesPerProbe(const Params& params);

}  // namespace probelab
