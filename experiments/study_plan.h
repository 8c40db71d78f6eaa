// SPDX-License-Identifier: GPL-3.0-or-later
// What a study's file says (study.h), before it is expanded to cells.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "study.h"

namespace probelab {

struct StudyAxisValue {
  std::string name;
  OptionValues options;
  std::string command;  // in place of the study's; empty: that one
  // Names of values of earlier axes, by axis: the value is for cells with one of each alone.
  std::map<std::string, std::vector<std::string>> beside;
};
struct StudyAxis {
  std::string name;
  std::vector<StudyAxisValue> values;
};

// What the file says, before it is expanded.
struct StudyPlan {
  std::string about, command;
  std::vector<std::string> scenes, states, seeds;
  bool named_states = false;  // `states` are names; else empty or one of all, train, heldout
  OptionValues options;
  std::vector<StudyAxis> axes;
};

// Scenes are paths that exist, from the folder of the study on. Throws InputError naming file, line
// and element.
StudyPlan readStudyPlan(const std::filesystem::path& path, const StudySelection& selection);

}  // namespace probelab
