// SPDX-License-Identifier: GPL-3.0-or-later
// The parameters that are tuned, and where they are searched. Those that act in the query alone are
// coordinates in [0, 1], both ends included; those that change the atlases are for an outer search.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "ddgi/params.h"

namespace probelab {

// Linear with knee 0. Else linear below low + knee and logarithmic above, so that a floor of 0 can
// be reached and small values are not crowded:
//   value = low + knee * (exp(x * log(1 + (high - low) / knee)) - 1)
struct TunedKey {
  std::string name;
  double Params::*value = nullptr;
  double low = 0, high = 1;  // searched; wider where the parameters start outside of it
  double knee = 0;
};

// A key that changes the atlases: each value needs a field of its own.
struct OuterKey {
  std::string name;
  double low = 0, high = 1;
  bool logarithmic = false;
  bool integer = false;  // rays, texels
};

inline constexpr const char* kDefaultKeys[] = {"normal_bias",      "view_bias",
                                               "visibility_floor", "chebyshev_power",
                                               "facing_offset",    "crush_threshold"};

// Those of kDefaultKeys that have an effect under `params`.
std::vector<std::string> defaultKeys(const Params& params);

struct KeySplit {
  std::vector<TunedKey> inner;  // act in the query
  std::vector<OuterKey> outer;
};
// By name. Throws InputError on one that does not exist, is named twice, is not continuous or a
// count, or has no effect: under the modes of `params` (crush_threshold without crush), with
// scattered probes (trilinear_floor) or on a converged field (hysteresis).
KeySplit tunedKeys(std::span<const std::string> names, const Params& params, bool lattice = true);

double keyValue(const TunedKey& key, double x);  // its ends within 1e-6 of them
double keySlope(const TunedKey& key, double x);           // of the value by x
double keyCoordinate(const TunedKey& key, double value);  // held to [0, 1]

// x[i] in [0, 1] of key i, and back.
std::vector<double> toCoordinates(std::span<const TunedKey> keys, const Params& params);
void setCoordinates(std::span<const TunedKey> keys, std::span<const double> x, Params& params);

// Sets the key, rounded where it is a count; Params::name stays.
void setOuterKey(const OuterKey& key, double value, Params& params);

}  // namespace probelab
