// SPDX-License-Identifier: GPL-3.0-or-later
// A study: a TOML file that says which commands to run on which scenes, states and settings. It
// expands to cells, each one command line whose JSON is the result. A cell's identity is the hash
// of the command with every option, of the bytes of the scene and of other files it names, and of
// the program's version: what has been computed is never computed again, and never taken for
// something else.
//
//   about = "Error against the number of probes"
//   command = "evaluate"          # any command with SCENE and --json
//   scenes = ["../../scenes/cornell/scene.toml"]    # relative to this file
//   states = "all"                # all | train | heldout | ["noon"]; without it: the first state
//   seeds = [1, 2, 3]
//   [options]                     # of every cell: --rays 128; true: a flag; a list: given again
//   rays = 128
//   [[axis]]                      # cells are the product of scenes, states, axes and seeds
//   name = "probes"
//   option = "probes"             # values of one option ...
//   values = [64, 256]
//   [[axis]]
//   name = "layout"
//   [[axis.value]]                # ... or named sets of options
//   name = "sparse"
//   options = { strategy = "grid_sparse" }
//   command = "budget"          # if it is another one than the study's
//   with = { probes = [256] }   # only beside these values of axes above; without it: beside all
//   [size.smoke]                  # --size smoke: a part of the study
//   scenes = ["cornell"]          # by a part of their path
//   seeds = [1]
//   axes = { probes = [64] }
//
// Inputs (`params`, `layout`, ...) lie beside the study. Outputs (`output`, `report`, `dump`, ...)
// are names within the cell's own folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "json.h"

namespace probelab {

using OptionValues = std::map<std::string, std::vector<std::string>>;  // "" stands for a flag

struct StudyCell {
  std::string id;  // 16 hexadecimal digits
  std::string command, scene;
  std::vector<std::pair<std::string, std::string>> axes;  // scene, state, the study's axes, seed
  OptionValues options;
};

struct Study {
  std::string name, about, path;
  std::vector<std::string> axes;  // names, in order
  std::vector<StudyCell> cells;
};

// Throws InputError for an option that the cells' command does not have. `known` gives the names of
// a command's options without dashes.
void checkOptionNames(const Study& study,
                      const std::function<std::vector<std::string>(const std::string&)>& known);

struct StudySelection {
  std::string size;         // empty: the whole study
  int scale = 1;            // times the seeds, and the options' count
  std::string device = {};  // --device; results of another one are other results
};

// Reads and expands a study. Throws InputError naming file, line and element.
Study loadStudy(const std::filesystem::path& path, const StudySelection& selection);

// "cornell, noon, 64, 1".
std::string axesText(const StudyCell& cell);

// What the cell's command writes besides its result, within the cell's folder: files, or folders
// that must be there before.
std::vector<std::filesystem::path> cellOutputs(const StudyCell& cell, bool folders);

// The command line of a cell after the program's name; outputs go to `files`.
std::vector<std::string> cellArguments(const StudyCell& cell, const std::filesystem::path& files);

}  // namespace probelab
