// SPDX-License-Identifier: GPL-3.0-or-later
#include "study.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "base/build_info.h"
#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "scene/load.h"
#include "study_plan.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

// Options that name a file of the cell's own folder, and those that name an input.
const std::set<std::string> kOutputs = {"output", "report", "bias-map", "fit-values", "glb"};
const std::set<std::string> kInputs = {"layout", "params", "ablation", "receivers", "values"};
constexpr std::size_t kMostCells = 100000;

// Options of a list are all given, others replace what was there.
void addOptions(OptionValues& options, const OptionValues& more) {
  for (const auto& [name, values] : more) {
    std::vector<std::string>& here = options[name];
    if (name == "set" || name == "option")
      here.insert(here.end(), values.begin(), values.end());
    else
      here = values;
  }
}

class Expansion {
 public:
  Expansion(const StudyPlan& plan, const fs::path& study)
      : plan_(plan), study_(study.string()), folder_(study.parent_path()) {}

  std::vector<StudyCell> cells() {
    for (const std::string& path : plan_.scenes) {
      const Scene scene = loadScene(path);
      for (const std::string& state : statesOf(scene)) {
        StudyCell cell;
        cell.command = plan_.command;
        cell.scene = path;
        cell.options = plan_.options;
        if (!state.empty()) cell.options["state"] = {state};
        cell.axes = {{"scene", nameOf(path)}, {"state", state.empty() ? scene.state : state}};
        addAxes(cell, 0, scene.content_hash);
      }
    }
    return std::move(cells_);
  }

 private:
  // "cornell", "thin_wall/scene_05cm": what is short and differs.
  static std::string nameOf(const fs::path& path) {
    const std::string folder = path.parent_path().filename().string();
    return path.stem() == "scene" ? folder : folder + "/" + path.stem().string();
  }

  std::vector<std::string> statesOf(const Scene& scene) const {
    if (plan_.states.empty() || scene.states.empty()) return {""};
    std::vector<std::string> names;
    for (const LightingState& state : scene.states) {
      const bool heldout = state.split == Split::heldout;
      const bool wanted = plan_.named_states ? std::find(plan_.states.begin(), plan_.states.end(),
                                                         state.name) != plan_.states.end()
                                             : plan_.states.front() == "all" ||
                                                   (plan_.states.front() == "heldout") == heldout;
      if (wanted) names.push_back(state.name);
    }
    if (names.empty()) throwInput("{}: {} has none of the study's states", study_, scene.path);
    return names;
  }

  void addAxes(const StudyCell& cell, std::size_t axis, const std::string& scene_hash) {
    if (axis == plan_.axes.size()) return addSeeds(cell, scene_hash);
    for (const StudyAxisValue& value : plan_.axes[axis].values) {
      StudyCell next = cell;
      addOptions(next.options, value.options);
      next.axes.push_back({plan_.axes[axis].name, value.name});
      addAxes(next, axis + 1, scene_hash);
    }
  }

  void addSeeds(const StudyCell& cell, const std::string& scene_hash) {
    for (const std::string& seed : plan_.seeds) {
      StudyCell next = cell;
      next.options["seed"] = {seed};
      next.axes.push_back({"seed", seed});
      identify(next, scene_hash);
      cells_.push_back(std::move(next));
      if (cells_.size() > kMostCells) throwInput("the study has more than {} cells", kMostCells);
    }
  }

  // Inputs lie beside the study; their bytes are part of the identity, their place is not.
  void identify(StudyCell& cell, const std::string& scene_hash) {
    Json key = {{"command", cell.command}, {"scene", scene_hash}, {"version", buildInfo().version}};
    for (auto& [name, values] : cell.options) {
      Json texts = Json::array();
      for (std::string& value : values) {
        const fs::path beside = folder_ / value;
        const bool file = kInputs.contains(name) && fs::is_regular_file(beside);
        texts.push_back(file ? contentHash(readFile(beside)) : value);
        if (file) value = beside.lexically_normal().string();
      }
      key["options"][name] = texts;
    }
    cell.id = contentHash(key.dump()).substr(0, 16);
  }

  const StudyPlan& plan_;
  std::string study_;
  fs::path folder_;
  std::vector<StudyCell> cells_;
};

}  // namespace

Study loadStudy(const fs::path& path, const StudySelection& selection) {
  const StudyPlan plan = readStudyPlan(path, selection);
  Study study;
  study.name = path.stem().string();
  study.about = plan.about;
  study.path = path.string();
  study.axes = {"scene", "state"};
  for (const StudyAxis& axis : plan.axes) study.axes.push_back(axis.name);
  study.axes.push_back("seed");
  study.cells = Expansion(plan, path).cells();
  std::set<std::string> ids;
  std::erase_if(study.cells, [&](const StudyCell& cell) { return !ids.insert(cell.id).second; });
  return study;
}

bool writesFiles(const StudyCell& cell) {
  return std::ranges::any_of(cell.options,
                             [](const auto& option) { return kOutputs.contains(option.first); });
}

std::vector<std::string> cellArguments(const StudyCell& cell, const fs::path& files) {
  std::vector<std::string> arguments = {cell.command, cell.scene};
  for (const auto& [name, values] : cell.options)
    for (const std::string& value : values) {
      arguments.push_back(name == "output" ? "-o" : "--" + name);
      if (kOutputs.contains(name))
        arguments.push_back((files / value).string());
      else if (!value.empty())
        arguments.push_back(value);
    }
  return arguments;
}

}  // namespace probelab
