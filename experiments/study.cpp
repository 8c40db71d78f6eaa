// SPDX-License-Identifier: GPL-3.0-or-later
#include "study.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "base/build_info.h"
#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "base/suggest.h"
#include "input_identity.h"
#include "scene/load.h"
#include "study_plan.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

// Options that name a file or an existing folder of the cell's own folder, and those that name an
// input.
const std::set<std::string> kOutputFiles = {"output", "bias-map", "fit-values", "glb", "dump"};
const std::set<std::string> kOutputFolders = {"report", "dump-field"};
const std::set<std::string> kInputs = {"layout", "params", "ablation", "receivers",
                                       "values", "from",   "against",  "points"};
const std::set<std::string> kInputLists = {"against"};  // of which several are named, a,b
const std::string kPathOption = "path=";                // of --option
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

bool isOutput(const std::string& option) {
  return kOutputFiles.contains(option) || kOutputFolders.contains(option);
}

// "cornell", "thin_wall/scene_05cm": as much of the end of each path as makes the names differ.
std::vector<std::string> sceneNames(const std::vector<std::string>& paths) {
  const auto nameOf = [](const fs::path& path, int folders) {
    fs::path name = path.stem() == "scene" ? fs::path() : path.stem();
    fs::path folder = path.parent_path();
    for (int i = 0; i < folders; ++i, folder = folder.parent_path())
      name = name.empty() ? folder.filename() : folder.filename() / name;
    return name.generic_string();
  };
  constexpr int kMostFolders = 32;
  std::vector<std::string> names;
  for (int folders = 1; folders < kMostFolders; ++folders) {
    names.clear();
    for (const std::string& path : paths) names.push_back(nameOf(fs::absolute(path), folders));
    if (std::set<std::string>(names.begin(), names.end()).size() == paths.size()) break;
  }
  return names;
}

class Expansion {
 public:
  Expansion(const StudyPlan& plan, const fs::path& study, const std::string& device)
      : plan_(plan), study_(study.string()), folder_(study.parent_path()), device_(device) {}

  std::vector<StudyCell> cells() {
    const std::vector<std::string> names = sceneNames(plan_.scenes);
    for (std::size_t i = 0; i < plan_.scenes.size(); ++i) {
      const std::string& path = plan_.scenes[i];
      const Scene scene = loadScene(path);
      for (const std::string& state : statesOf(scene)) {
        StudyCell cell;
        cell.command = plan_.command;
        cell.scene = path;
        cell.options = plan_.options;
        if (!state.empty()) cell.options["state"] = {state};
        cell.axes = {{"scene", names[i]}, {"state", state.empty() ? ownState(scene) : state}};
        addAxes(cell, 0, scene.content_hash);
      }
    }
    for (const std::string& state : plan_.states)
      if (plan_.named_states && !seen_states_.contains(state))
        throwInput("{}: no scene has the state '{}'{}", study_, state,
                   suggestion(state, std::vector<std::string>(other_states_.begin(),
                                                              other_states_.end())));
    if (cells_.empty())
      throwInput("{}: the study has no cell; 'with' asks for values that are left out", study_);
    return std::move(cells_);
  }

 private:
  // Of a study that names no states: the scene's first, but `tune` has all train states at once.
  std::string ownState(const Scene& scene) const {
    return plan_.command == "tune" ? "train" : scene.state;
  }

  std::vector<std::string> statesOf(const Scene& scene) {
    if (plan_.states.empty() || scene.states.empty()) return {""};
    std::vector<std::string> names;
    for (const LightingState& state : scene.states) {
      const bool heldout = state.split == Split::heldout;
      const bool wanted = plan_.named_states ? std::find(plan_.states.begin(), plan_.states.end(),
                                                         state.name) != plan_.states.end()
                                             : plan_.states.front() == "all" ||
                                                   (plan_.states.front() == "heldout") == heldout;
      if (wanted) names.push_back(state.name);
      (wanted ? seen_states_ : other_states_).insert(state.name);
    }
    if (names.empty()) throwInput("{}: {} has none of the study's states", study_, scene.path);
    return names;
  }

  static bool standsBeside(const StudyAxisValue& value, const StudyCell& cell) {
    return std::ranges::all_of(cell.axes, [&](const auto& axis) {
      const auto wanted = value.beside.find(axis.first);
      return wanted == value.beside.end() ||
             std::ranges::find(wanted->second, axis.second) != wanted->second.end();
    });
  }

  void addAxes(const StudyCell& cell, std::size_t axis, const std::string& scene_hash) {
    if (axis == plan_.axes.size()) return addSeeds(cell, scene_hash);
    for (const StudyAxisValue& value : plan_.axes[axis].values) {
      if (!standsBeside(value, cell)) continue;
      StudyCell next = cell;
      addOptions(next.options, value.options);
      if (!value.command.empty()) next.command = value.command;
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
      const auto [same, is_new] = ids_.try_emplace(next.id, axesText(next));
      if (!is_new)
        throwInput("{}: the cells '{}' and '{}' are one and the same; an axis has no effect",
                   study_, same->second, axesText(next));
      cells_.push_back(std::move(next));
      if (cells_.size() > kMostCells) throwInput("the study has more than {} cells", kMostCells);
    }
  }

  // Inputs lie beside the study; their bytes are part of the identity, their place is not.
  void identify(StudyCell& cell, const std::string& scene_hash) {
    Json key = {{"command", cell.command},
                {"scene", scene_hash},
                {"version", buildInfo().version},
                {"device", device_}};
    for (auto& [name, values] : cell.options) {
      Json texts = Json::array();
      for (std::string& value : values) texts.push_back(identifyValue(name, value));
      key["options"][name] = texts;
    }
    for (const bool folders : {false, true})
      for (const fs::path& output : cellOutputs(cell, folders))
        if (output.empty() || output.is_absolute() || *output.lexically_normal().begin() == "..")
          throwInput("{}: output '{}' must be a name within the cell's own folder", study_,
                     output.string());
    cell.id = contentHash(key.dump()).substr(0, 16);
  }

  // What stands for a value in the identity; the value of an input becomes its path.
  std::string identifyValue(const std::string& name, std::string& value) const {
    const bool path_option = name == "option" && value.starts_with(kPathOption);
    if (!path_option && !kInputs.contains(name)) return value;
    const std::string prefix = path_option ? kPathOption : "";
    std::string rest = value.substr(prefix.size());
    if (!kInputLists.contains(name) || isFile(folder_ / rest)) {
      const std::string identity = identifyFile(rest);
      value = prefix + rest;
      return prefix + identity;
    }
    std::string identities;
    value.clear();
    for (std::size_t begin = 0; begin <= rest.size();) {
      const std::size_t end = std::min(rest.find(',', begin), rest.size());
      std::string part = rest.substr(begin, end - begin);
      identities += (begin > 0 ? "," : "") + identifyFile(part);
      value += (begin > 0 ? "," : "") + part;
      begin = end + 1;
    }
    return identities;
  }

  // The hash of a file beside the study, and `name` as the way there; a name of no file as it is.
  std::string identifyFile(std::string& name) const {
    const fs::path beside = folder_ / name;
    if (!isFile(beside)) return name;
    name = beside.lexically_normal().string();
    return inputIdentity(beside);
  }

  const StudyPlan& plan_;
  std::string study_;
  fs::path folder_;
  std::string device_;
  std::set<std::string> seen_states_, other_states_;
  std::map<std::string, std::string> ids_;  // and the cell's axes
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
  study.cells = Expansion(plan, path, selection.device).cells();
  return study;
}

void checkOptionNames(const Study& study,
                      const std::function<std::vector<std::string>(const std::string&)>& known) {
  std::map<std::string, std::vector<std::string>> names;
  for (const StudyCell& cell : study.cells) {
    std::vector<std::string>& of = names[cell.command];
    if (of.empty()) of = known(cell.command);
    for (const auto& [name, values] : cell.options)
      if (std::find(of.begin(), of.end(), name) == of.end())
        throwInput("{}: {} has no option '{}'{}", study.path, cell.command, name,
                   suggestion(name, of));
  }
}

std::string axesText(const StudyCell& cell) {
  std::string text;
  for (const auto& [name, value] : cell.axes) text += (text.empty() ? "" : ", ") + value;
  return text;
}

std::vector<fs::path> cellOutputs(const StudyCell& cell, bool folders) {
  std::vector<fs::path> outputs;
  for (const auto& [name, values] : cell.options)
    if ((folders ? kOutputFolders : kOutputFiles).contains(name))
      outputs.insert(outputs.end(), values.begin(), values.end());
  return outputs;
}

std::vector<std::string> cellArguments(const StudyCell& cell, const fs::path& files) {
  std::vector<std::string> arguments = {cell.command, cell.scene};
  for (const auto& [name, values] : cell.options)
    for (const std::string& value : values) {
      arguments.push_back(name == "output" ? "-o" : "--" + name);
      if (isOutput(name))
        arguments.push_back((files / value).string());
      else if (!value.empty())
        arguments.push_back(value);
    }
  return arguments;
}

}  // namespace probelab
