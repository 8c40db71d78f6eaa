// SPDX-License-Identifier: GPL-3.0-or-later
#include "tuning/tuned_keys.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/suggest.h"

namespace probelab {
namespace {

constexpr double kAtEnd = 1e-6;  // a coordinate so near to an end of its range is there

// Ranges hold every preset and NVIDIA's own scenes (normal bias .03 to .30, view bias .18 to .80 of
// the spacing) with room on both sides. A weight before the crush is at most 1 + facing_offset.
const std::vector<TunedKey>& queryKeys() {
  static const std::vector<TunedKey> keys = {
      {"normal_bias", &Params::normal_bias, 0, 0.5, 0},
      {"view_bias", &Params::view_bias, 0, 1, 0},
      {"facing_offset", &Params::facing_offset, 0, 1, 0.05},
      {"trilinear_floor", &Params::trilinear_floor, 0, 0.2, 1e-3},
      {"chebyshev_power", &Params::chebyshev_power, 0.5, 32, 0.5},
      {"visibility_floor", &Params::visibility_floor, 0, 0.5, 1e-3},
      {"variance_bias", &Params::variance_bias, 0, 0.1, 1e-4},
      {"crush_threshold", &Params::crush_threshold, 0.01, 2, 0.01},
      {"parallax", &Params::parallax, 0, 2, 0},
  };
  return keys;
}

const std::vector<OuterKey>& atlasKeys() {
  static const std::vector<OuterKey> keys = {
      {"distance_exponent", 10, 500, true, false},
      {"distance_clamp", 0.75, 3, true, false},
      {"backface_shortening", 0, 1, false, false},
      {"backface_freeze", 0, 1, false, false},
      {"encoding_gamma", 1, 8, true, false},
      {"texture_footprint", 0, 4, false, false},
      {"relocation_limit", 0, 0.5, false, false},
      {"relocation_front", 0, 0.5, false, false},
      {"backface_threshold", 0.05, 0.95, false, false},
      {"rays", 32, 1024, true, true},
      {"irradiance_texels", 4, 16, false, true},
      {"moment_texels", 6, 32, false, true},
  };
  return keys;
}

// Why the key does nothing; empty: it acts.
std::string whyIdle(const std::string& name, const Params& params, bool lattice) {
  if (name == "facing_offset" && params.facing == PL_FACING_NONE) return "facing is none";
  if (name == "trilinear_floor" && !lattice) return "the layout is not a lattice";
  if (name == "trilinear_floor" && params.trilinear == PL_TRILINEAR_PLAIN)
    return "trilinear is plain";
  if ((name == "chebyshev_power" || name == "visibility_floor" || name == "variance_bias" ||
       name == "distance_exponent" || name == "distance_clamp" || name == "moment_texels" ||
       name == "backface_shortening" || name == "parallax") &&
      params.visibility == 0)
    return "visibility is false";
  if (name == "crush_threshold" && params.crush == PL_CRUSH_NONE) return "crush is none";
  if ((name == "relocation_limit" || name == "relocation_front") && params.relocation == 0)
    return "relocation is false";
  if (name == "backface_threshold" && params.relocation == 0 && params.classification == 0)
    return "relocation is false and classification none";
  return "";
}

std::vector<std::string> tunableNames() {
  std::vector<std::string> names;
  for (const TunedKey& key : queryKeys()) names.push_back(key.name);
  for (const OuterKey& key : atlasKeys()) names.push_back(key.name);
  return names;
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

[[noreturn]] void refuseName(const std::string& name) {
  std::vector<std::string> known;
  for (const ParamInfo& info : paramTable()) known.push_back(info.key);
  if (std::find(known.begin(), known.end(), name) == known.end())
    throwInput("--vary: unknown parameter '{}'{}", name, suggestion(name, known));
  throwInput("--vary: {} cannot be tuned on converged fields; these can: {}", name,
             joined(tunableNames()));
}

}  // namespace

std::vector<std::string> defaultKeys(const Params& params) {
  std::vector<std::string> names;
  for (const char* name : kDefaultKeys)
    if (whyIdle(name, params, true).empty()) names.emplace_back(name);
  return names;
}

KeySplit tunedKeys(std::span<const std::string> names, const Params& params, bool lattice) {
  KeySplit split;
  for (auto name = names.begin(); name != names.end(); ++name) {
    if (std::find(names.begin(), name, *name) != name)
      throwInput("--vary: parameter {} is named twice", *name);
    const auto is_named = [&](const auto& key) { return key.name == *name; };
    const auto inner = std::find_if(queryKeys().begin(), queryKeys().end(), is_named);
    const auto outer = std::find_if(atlasKeys().begin(), atlasKeys().end(), is_named);
    if (inner == queryKeys().end() && outer == atlasKeys().end()) refuseName(*name);
    if (const std::string why = whyIdle(*name, params, lattice); !why.empty())
      throwInput("--vary: {} has no effect: {}; leave it out or change that", *name, why);
    if (outer != atlasKeys().end()) {
      split.outer.push_back(*outer);
      continue;
    }
    TunedKey key = *inner;
    key.low = std::min(key.low, params.*key.value);
    key.high = std::max(key.high, params.*key.value);
    split.inner.push_back(key);
  }
  return split;
}

double keyValue(const TunedKey& key, double x) {
  const double range = key.high - key.low;
  // Without rounding; and the sigmoid of the search comes near the ends alone, where what a value of
  // 0 leaves out of the query would still be there.
  if (x > 1 - kAtEnd) return key.high;
  if (x < kAtEnd) return key.low;
  if (key.knee == 0) return key.low + range * x;
  return key.low + key.knee * std::expm1(x * std::log1p(range / key.knee));
}

double keySlope(const TunedKey& key, double x) {
  const double range = key.high - key.low;
  if (key.knee == 0) return range;
  const double growth = std::log1p(range / key.knee);
  return key.knee * growth * std::exp(x * growth);
}

double keyCoordinate(const TunedKey& key, double value) {
  const double range = key.high - key.low;
  const double x = key.knee == 0
                       ? (value - key.low) / range
                       : std::log1p((value - key.low) / key.knee) / std::log1p(range / key.knee);
  return std::clamp(x, 0.0, 1.0);
}

std::vector<double> toCoordinates(std::span<const TunedKey> keys, const Params& params) {
  std::vector<double> x;
  for (const TunedKey& key : keys) x.push_back(keyCoordinate(key, params.*key.value));
  return x;
}

void setCoordinates(std::span<const TunedKey> keys, std::span<const double> x, Params& params) {
  for (std::size_t i = 0; i < keys.size(); ++i) params.*keys[i].value = keyValue(keys[i], x[i]);
}

void setOuterKey(const OuterKey& key, double value, Params& params) {
  const std::string name = params.name;
  const double held = std::clamp(value, key.low, key.high);
  setParam(params, key.integer ? fmt::format("{}={}", key.name, std::lround(held))
                               : fmt::format("{}={}", key.name, held));
  params.name = name;
}

}  // namespace probelab
