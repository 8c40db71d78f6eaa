// SPDX-License-Identifier: GPL-3.0-or-later
#include "study_plan.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>

#include "base/error.h"
#include "base/files.h"
#include "base/parse_toml.h"
#include "base/suggest.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kStudyKeys = {"about", "command", "scenes", "states",
                                             "seeds", "options", "axis",   "size"};
const char* const kScriptKey = "script";  // of studies that a script of their own runs
const std::vector<std::string> kAxisKeys = {"name", "option", "values", "value"};
const std::vector<std::string> kValueKeys = {"name", "options", "command", "with"};
const std::vector<std::string> kSizeKeys = {"scenes", "states", "seeds", "axes", "options"};
const std::vector<std::string> kCommands = {"evaluate", "tune", "budget", "bench", "place"};
constexpr std::size_t kMostSeeds = 10000;
const std::vector<std::string> kStateChoices = {"all", "train", "heldout"};

// A TOML file while it is read: for messages.
struct Reader {
  std::string path;

  std::string at(const toml::node& node) const {
    return fmt::format("{}:{}", path, node.source().begin.line);
  }
  void checkKeys(const toml::table& table, const std::vector<std::string>& known) const {
    for (const auto& [key, node] : table) {
      const std::string name(key.str());
      if (std::find(known.begin(), known.end(), name) == known.end())
        throwInput("{}: unknown key '{}'{}", at(node), name, suggestion(name, known));
    }
  }
  std::string text(const toml::node& node, const char* what) const {
    const auto value = node.value_exact<std::string>();
    if (!value || value->empty()) throwInput("{}: {} must be a text in quotes", at(node), what);
    return *value;
  }
  const toml::array& list(const toml::node& node, const char* what) const {
    const toml::array* array = node.as_array();
    if (array == nullptr || array->empty())
      throwInput("{}: {} must be a list in brackets, and not empty", at(node), what);
    return *array;
  }
  std::vector<std::string> texts(const toml::node& node, const char* what) const {
    std::vector<std::string> all;
    for (const toml::node& element : list(node, what)) all.push_back(text(element, what));
    return all;
  }
  // A number, text or switch as it stands on a command line.
  std::string scalar(const toml::node& node, const std::string& what) const {
    if (const auto value = node.value_exact<std::string>(); value && !value->empty()) return *value;
    if (const auto value = node.value_exact<int64_t>()) return fmt::format("{}", *value);
    if (const auto value = node.value_exact<double>()) return fmt::format("{}", *value);
    throwInput("{}: {} must be a number or a text, and not empty", at(node), what);
  }
  std::vector<std::string> optionValues(const toml::node& node, const std::string& name) const {
    if (const auto flag = node.value_exact<bool>())
      return *flag ? std::vector<std::string>{""} : std::vector<std::string>{};
    const toml::array* array = node.as_array();
    if (array == nullptr) return {scalar(node, name)};
    std::vector<std::string> values;
    for (const toml::node& element : *array) values.push_back(scalar(element, name));
    return values;
  }
  OptionValues options(const toml::node& node) const {
    if (!node.is_table()) throwInput("{}: options must be a table", at(node));
    OptionValues options;
    for (const auto& [key, value] : *node.as_table()) {
      const std::string name(key.str());
      for (const char* reserved : {"seed", "state", "json", "cache", "require", "scene", "threads",
                                   "device", "quiet", "validation"})
        if (name == reserved)
          throwInput("{}: '{}' is not for options{}", at(value), name,
                     name == "seed"    ? "; write seeds = [...]"
                     : name == "state" ? "; write states = ..."
                                       : "");
      options[name] = optionValues(value, name);
    }
    return options;
  }
  std::string command(const toml::node& node) const {
    const std::string name = text(node, "command");
    if (std::find(kCommands.begin(), kCommands.end(), name) == kCommands.end())
      throwInput("{}: command is '{}'{}", at(node), name, suggestion(name, kCommands));
    return name;
  }
  std::vector<std::string> seeds(const toml::node& node) const {
    std::vector<std::string> seeds;
    std::set<int64_t> seen;
    for (const toml::node& element : list(node, "seeds")) {
      const auto value = element.value_exact<int64_t>();
      if (!value || *value < 0) throwInput("{}: seeds must be whole numbers from 0", at(element));
      if (!seen.insert(*value).second)
        throwInput("{}: seed {} stands twice", at(element), *value);
      seeds.push_back(fmt::format("{}", *value));
      if (seeds.size() > kMostSeeds) throwInput("{}: more than {} seeds", at(node), kMostSeeds);
    }
    return seeds;
  }
};

// Keeps the wanted values alone, in the order of `wanted`.
void narrowAxis(const Reader& read, const toml::node& wanted, StudyAxis& axis) {
  std::vector<std::string> names;
  for (const StudyAxisValue& value : axis.values) names.push_back(value.name);
  std::vector<StudyAxisValue> kept;
  for (const toml::node& node : read.list(wanted, axis.name.c_str())) {
    const std::string name = read.scalar(node, axis.name);
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end())
      throwInput("{}: axis '{}' has no '{}'{}", read.at(node), axis.name, name,
                 suggestion(name, names));
    kept.push_back(axis.values[static_cast<std::size_t>(found - names.begin())]);
  }
  axis.values = std::move(kept);
}

// What a value stands beside: values of the axes above it.
std::map<std::string, std::vector<std::string>> readBeside(const Reader& read,
                                                           const toml::node& node,
                                                           const std::vector<StudyAxis>& above) {
  if (!node.is_table())
    throwInput("{}: with must be a table, as with = {{ axis = [value] }}", read.at(node));
  std::vector<std::string> axes;
  for (const StudyAxis& axis : above) axes.push_back(axis.name);
  std::map<std::string, std::vector<std::string>> beside;
  for (const auto& [key, wanted] : *node.as_table()) {
    const std::string name(key.str());
    const auto axis = std::find(axes.begin(), axes.end(), name);
    if (axis == axes.end())
      throwInput("{}: with: no axis above has the name '{}'{}", read.at(wanted), name,
                 suggestion(name, axes));
    StudyAxis kept = above[static_cast<std::size_t>(axis - axes.begin())];
    narrowAxis(read, wanted, kept);
    for (const StudyAxisValue& value : kept.values) beside[name].push_back(value.name);
  }
  return beside;
}

std::string readAxisName(const Reader& read, const toml::table& table, const toml::node& node) {
  const std::string name = read.text(node, "name");
  for (const char* own : {"scene", "state", "seed"})
    if (name == own)
      throwInput("{}: '{}' is an axis of every study; see {}s", read.at(table), own, own);
  for (const char* own : {"id", "seconds"})
    if (name == own)
      throwInput("{}: '{}' is a column of every study's table; give the axis another name",
                 read.at(table), own);
  return name;
}

// `above`: the axes before its own.
StudyAxisValue readAxisValue(const Reader& read, const toml::node& entry,
                             const std::vector<StudyAxis>& above) {
  if (!entry.is_table()) throwInput("{}: write values as [[axis.value]]", read.at(entry));
  const toml::table& table = *entry.as_table();
  read.checkKeys(table, kValueKeys);
  if (table.get("name") == nullptr) throwInput("{}: a value needs a name", read.at(entry));
  StudyAxisValue value{read.text(*table.get("name"), "name"), {}, {}, {}};
  if (const toml::node* options = table.get("options")) value.options = read.options(*options);
  if (const toml::node* command = table.get("command")) value.command = read.command(*command);
  if (const toml::node* beside = table.get("with"))
    value.beside = readBeside(read, *beside, above);
  return value;
}

// `above`: the axes before it.
StudyAxis readAxis(const Reader& read, const toml::node& node,
                   const std::vector<StudyAxis>& above) {
  if (!node.is_table()) throwInput("{}: write axes as [[axis]]", read.at(node));
  const toml::table& table = *node.as_table();
  read.checkKeys(table, kAxisKeys);
  const auto need = [&](const char* key) -> const toml::node& {
    if (const toml::node* found = table.get(key)) return *found;
    throwInput("{}: an axis needs '{}'", read.at(table), key);
  };
  StudyAxis axis;
  axis.name = readAxisName(read, table, need("name"));
  if (const toml::node* values = table.get("value")) {
    for (const char* other : {"option", "values"})
      if (const toml::node* found = table.get(other))
        throwInput("{}: an axis has [[axis.value]] or option and values, not both",
                   read.at(*found));
    for (const toml::node& entry : read.list(*values, "value"))
      axis.values.push_back(readAxisValue(read, entry, above));
  } else {
    const std::string option = read.text(need("option"), "option");
    for (const toml::node& entry : read.list(need("values"), "values")) {
      const std::string value = read.scalar(entry, option);
      axis.values.push_back({value, {{option, {value}}}, {}, {}});
    }
  }
  std::set<std::string> names;
  for (const StudyAxisValue& value : axis.values)
    if (!names.insert(value.name).second)
      throwInput("{}: axis '{}' has '{}' twice", read.at(table), axis.name, value.name);
  return axis;
}

void readStates(const Reader& read, const toml::node& node, StudyPlan& plan) {
  plan.named_states = node.is_array();
  plan.states = node.is_array() ? read.texts(node, "states")
                                : std::vector<std::string>{read.text(node, "states")};
  if (!plan.named_states && std::find(kStateChoices.begin(), kStateChoices.end(),
                                      plan.states.front()) == kStateChoices.end())
    throwInput("{}: states is '{}'{}; or give names in brackets", read.at(node),
               plan.states.front(), suggestion(plan.states.front(), kStateChoices));
}

StudyPlan readPlan(const Reader& read, const toml::table& table) {
  if (const toml::node* script = table.get(kScriptKey))
    throwInput("{}: no study for 'probelab run'; {} runs it", read.at(*script),
               read.text(*script, kScriptKey));
  read.checkKeys(table, kStudyKeys);
  const auto need = [&](const char* key) -> const toml::node& {
    if (const toml::node* found = table.get(key)) return *found;
    throwInput("{}: a study needs '{}'", read.path, key);
  };
  StudyPlan plan;
  plan.about = read.text(need("about"), "about");
  plan.command = read.command(need("command"));
  for (const std::string& scene : read.texts(need("scenes"), "scenes")) {
    const fs::path path = fs::path(read.path).parent_path() / scene;
    if (!isFile(path))
      throwInput("{}: scene '{}' is not there", read.at(need("scenes")), scene);
    const std::string normal = path.lexically_normal().string();
    plan.scenes.push_back(normal.starts_with('-') ? "./" + normal : normal);
    if (std::count(plan.scenes.begin(), plan.scenes.end(), plan.scenes.back()) > 1)
      throwInput("{}: scene '{}' stands twice", read.at(need("scenes")), scene);
  }
  if (const toml::node* states = table.get("states")) readStates(read, *states, plan);
  plan.seeds = read.seeds(need("seeds"));
  if (const toml::node* options = table.get("options")) plan.options = read.options(*options);
  if (const toml::node* axes = table.get("axis"))
    for (const toml::node& axis : read.list(*axes, "axis")) {
      plan.axes.push_back(readAxis(read, axis, plan.axes));
      for (std::size_t i = 0; i + 1 < plan.axes.size(); ++i)
        if (plan.axes[i].name == plan.axes.back().name)
          throwInput("{}: there is an axis '{}' already", read.at(axis), plan.axes[i].name);
    }
  return plan;
}

void narrowScenes(const Reader& read, const toml::node& wanted, StudyPlan& plan) {
  std::vector<std::string> kept;
  for (const std::string& part : read.texts(wanted, "scenes")) {
    const std::size_t before = kept.size();
    for (const std::string& scene : plan.scenes)
      if (scene.find(part) != std::string::npos &&
          std::find(kept.begin(), kept.end(), scene) == kept.end())
        kept.push_back(scene);
    if (kept.size() == before)
      throwInput("{}: no further scene's path contains '{}'", read.at(wanted), part);
  }
  plan.scenes = std::move(kept);
}

// The names of the sizes, all of which are well formed, not only the one that is asked for.
std::vector<std::string> readSizes(const Reader& read, const toml::table& table) {
  std::vector<std::string> names;
  const toml::node* sizes = table.get("size");
  if (sizes == nullptr) return names;
  if (!sizes->is_table()) throwInput("{}: write sizes as [size.NAME]", read.at(*sizes));
  for (const auto& [key, node] : *sizes->as_table()) {
    names.emplace_back(key.str());
    if (!node.is_table()) throwInput("{}: write sizes as [size.{}]", read.at(node), names.back());
    read.checkKeys(*node.as_table(), kSizeKeys);
  }
  return names;
}

void applySize(const Reader& read, const toml::table& table, const std::string& size,
               StudyPlan& plan) {
  const std::vector<std::string> names = readSizes(read, table);
  if (size.empty()) return;
  if (std::find(names.begin(), names.end(), size) == names.end())
    throwInput("--size: {} has no size '{}'{}", read.path, size,
               names.empty() ? "; it has no sizes" : suggestion(size, names));
  const toml::table* part = table["size"][size].as_table();
  if (const toml::node* scenes = part->get("scenes")) narrowScenes(read, *scenes, plan);
  if (const toml::node* states = part->get("states")) readStates(read, *states, plan);
  if (const toml::node* seeds = part->get("seeds")) plan.seeds = read.seeds(*seeds);
  if (const toml::node* options = part->get("options"))
    for (auto& [name, values] : read.options(*options)) plan.options[name] = values;
  const toml::node* axes = part->get("axes");
  if (axes == nullptr) return;
  if (!axes->is_table()) throwInput("{}: axes must be a table", read.at(*axes));
  for (const auto& [key, node] : *axes->as_table()) {
    const std::string name(key.str());
    const auto axis = std::find_if(plan.axes.begin(), plan.axes.end(),
                                   [&](const StudyAxis& a) { return a.name == name; });
    if (axis == plan.axes.end()) throwInput("{}: there is no axis '{}'", read.at(node), name);
    narrowAxis(read, node, *axis);
  }
}

// What these set: options, and of `set` and `option` the parameters and options by name.
std::vector<std::string> namesSetBy(const OptionValues& options) {
  std::vector<std::string> names;
  for (const auto& [option, values] : options) {
    if (option != "set" && option != "option") {
      names.push_back(option);
      continue;
    }
    for (const std::string& pair : values)
      names.push_back(fmt::format("{} {}", option, pair.substr(0, pair.find('='))));
  }
  return names;
}

// What two axes set would be the later one's, whatever the earlier one says.
void checkAxes(const Reader& read, const StudyPlan& plan) {
  std::map<std::string, std::string> set_by;
  for (const StudyAxis& axis : plan.axes)
    for (const StudyAxisValue& value : axis.values)
      for (const std::string& name : namesSetBy(value.options)) {
        const auto [other, is_new] = set_by.try_emplace(name, axis.name);
        if (!is_new && other->second != axis.name)
          throwInput("{}: the axes '{}' and '{}' both set '{}'", read.path, other->second,
                     axis.name, name);
      }
}

// One of the study, or of a size, that every value of an axis sets would have no effect.
void checkOptions(const Reader& read, const StudyPlan& plan) {
  for (const StudyAxis& axis : plan.axes)
    for (const std::string& name : namesSetBy(plan.options))
      if (std::ranges::all_of(axis.values, [&](const StudyAxisValue& value) {
            return std::ranges::count(namesSetBy(value.options), name) > 0;
          }))
        throwInput("{}: the axis '{}' sets '{}', so that the options' has no effect", read.path,
                   axis.name, name);
}

// More seeds, and more receivers, for machines that can afford them.
void applyScale(int scale, StudyPlan& plan) {
  std::set<std::string> seeds(plan.seeds.begin(), plan.seeds.end());
  const std::size_t wanted = plan.seeds.size() * static_cast<std::size_t>(scale);
  if (wanted > kMostSeeds) throwInput("--scale {}: more than {} seeds", scale, kMostSeeds);
  for (int next = 1; plan.seeds.size() < wanted; ++next)
    if (seeds.insert(std::to_string(next)).second) plan.seeds.push_back(std::to_string(next));
  const auto count = plan.options.find("count");
  if (scale == 1 || count == plan.options.end() || count->second.empty()) return;
  std::string& text = count->second.front();
  int receivers = 0;
  if (std::from_chars(text.data(), text.data() + text.size(), receivers).ec == std::errc())
    text = std::to_string(static_cast<int64_t>(receivers) * scale);
}

}  // namespace

StudyPlan readStudyPlan(const fs::path& path, const StudySelection& selection) {
  const Reader read{path.string()};
  const toml::table table = parseToml(readTextFile(path), path.string());
  StudyPlan plan = readPlan(read, table);
  checkAxes(read, plan);
  applySize(read, table, selection.size, plan);
  checkOptions(read, plan);
  applyScale(selection.scale, plan);
  return plan;
}

}  // namespace probelab
