// SPDX-License-Identifier: GPL-3.0-or-later
// The options of `tune`, and the checks that need nothing but them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tune_run.h"
#include "tune_scene.h"

namespace CLI {
class App;
}

namespace probelab {

// In the folder of --report.
constexpr const char* kTuneTableFile = "tune.json";
constexpr const char* kTuneMapFile = "bias_map.csv";

struct TuneOptions {
  std::vector<std::string> scenes;
  TuneSceneOptions of;
  TuneSettings settings;
  std::string output, report, bias_map, fit_values;
  int bias_map_size = 64;
  std::vector<std::string> vary;
  std::vector<std::string> against = {"rtxgi", "majercik2021", "gdc2019"};
  bool leave_one_out = false;
  std::optional<int> compare_searches;
};

// All but the common ones.
void addTuneOptions(CLI::App& app, TuneOptions& options);

// Throws InputError for scenes, outputs and options that do not go together, and for outputs that
// cannot be written or would replace what is read.
void checkTuneOptions(const TuneOptions& options);

}  // namespace probelab
