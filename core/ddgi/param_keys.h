// SPDX-License-Identifier: Apache-2.0
// The one table of parameters: name, unit, range and when to change it.
#pragma once

#include <span>
#include <string>
#include <variant>
#include <vector>

#include "ddgi/params.h"

namespace probelab {

struct RealKey {
  double Params::*member;
  double low, high;
};
struct IntKey {
  int Params::*member;
  int low, high;
};
struct SwitchKey {
  int Params::*member;
};
struct ChoiceKey {  // the member holds the index of the name
  int Params::*member;
  std::vector<std::string> names;
};

struct ParamKey {
  std::string name, unit;
  std::variant<RealKey, IntKey, SwitchKey, ChoiceKey> kind;
  std::string advice;
};

std::span<const ParamKey> paramKeys();

}  // namespace probelab
