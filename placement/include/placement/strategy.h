// SPDX-License-Identifier: GPL-3.0-or-later
// Placement strategies: scene and budget in, ProbeLayout out. A strategy is one file that defines a
// Strategy; strategies.cpp lists them.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "ddgi/layout.h"
#include "ddgi/params.h"
#include "scene/scene.h"
#include "trace/embree_scene.h"
#include "trace/reachability.h"

namespace probelab {

class Training;  // placement/training.h

// One option of a strategy, as `place --strategy S --help` lists it.
struct StrategyOption {
  std::string name;
  std::string fallback;     // default value
  std::string range;        // "0 .. 1", "lattice | knn", "FILE"
  std::string description;  // one line, with the unit
};

using OptionValues = std::map<std::string, std::string>;

struct PlacementInput;

// The layout of another strategy with its default options for the same input.
using OtherLayout =
    std::function<ProbeLayout(const std::string& strategy, const PlacementInput& input)>;

struct PlacementInput {
  const Scene& scene;  // its states are the lighting that a strategy may train on
  const EmbreeScene& embree;
  const Reachability& reachability;
  const Params& params;  // how the layout will be read, for strategies that score
  Training& training;    // train receivers under many lights; made at the first use
  int probes = 0;        // budget N: at most that many probes own texels
  uint64_t seed = 0;
  OptionValues options;  // every option of the strategy, defaults filled in
  std::set<std::string> given = {};  // of these, the ones that a person asked for
  std::function<void(double)> progress = {};  // share done
  OtherLayout other = {};  // where layouts may lie that were made before; empty: each is made
};

// By input.other.
ProbeLayout otherLayout(const std::string& strategy, const PlacementInput& input);

// Option values by type; throw InputError naming the option. `word`: what it may be instead of a
// number, for the message.
double numberOption(const PlacementInput& input, const std::string& name, double least,
                    double most, const std::string& word = {});
int integerOption(const PlacementInput& input, const std::string& name, int least, int most);
// The index in `names`.
int choiceOption(const PlacementInput& input, const std::string& name,
                 const std::vector<std::string>& names);

struct Strategy {
  std::string name;
  std::string description;  // one line for help pages
  std::vector<StrategyOption> options;
  ProbeLayout (*place)(const PlacementInput& input);
};

std::span<const Strategy> strategies();

// Throws InputError for an unknown name (with the nearest).
const Strategy& findStrategy(const std::string& name);

// "k=v" pairs over the strategy's defaults. Throws InputError for an unknown name (with the
// nearest) or one given twice.
OptionValues resolveOptions(const Strategy& strategy, const std::vector<std::string>& pairs);

// Runs the named strategy and fills the layout's provenance. Throws InputError for an unknown
// strategy or option and a budget below 1 or above 2^24.
ProbeLayout placeProbes(const std::string& strategy, const PlacementInput& input);

}  // namespace probelab
