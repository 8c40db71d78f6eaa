// SPDX-License-Identifier: GPL-3.0-or-later
#include "ablation.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "ablation_files.h"
#include "base/error.h"
#include "base/files.h"
#include "base/parse_toml.h"
#include "base/suggest.h"

namespace probelab {
namespace {

const std::vector<std::string> kFileKeys = {"about", "row"};
const std::vector<std::string> kRowKeys = {"name",   "about",          "set",       "else_set",
                                           "params", "probes",         "ray_proxy", "vertical",
                                           "mode",   "clamp_over_mean"};
const std::vector<std::string> kModes = {"converged", "temporal"};

std::string placeOf(const std::string& path, const toml::node& node) {
  return fmt::format("{}:{}", path, node.source().begin.line);
}

void checkKeys(const toml::table& table, const std::vector<std::string>& known,
               const std::string& path) {
  for (const auto& [key, node] : table) {
    const std::string name(key.str());
    if (std::find(known.begin(), known.end(), name) == known.end())
      throwInput("{}: unknown key '{}'{}", placeOf(path, node), name, suggestion(name, known));
  }
}

std::string readText(const toml::table& table, const char* key, const std::string& path) {
  const toml::node* node = table.get(key);
  if (node == nullptr) return "";
  const auto value = node->value_exact<std::string>();
  if (!value) throwInput("{}: {} must be a text in quotes", placeOf(path, *node), key);
  return *value;
}

std::optional<double> readNumber(const toml::table& table, const char* key,
                                 const std::string& path) {
  const toml::node* node = table.get(key);
  if (node == nullptr) return std::nullopt;
  const auto value = node->value<double>();
  if (!value || !std::isfinite(*value) || *value <= 0)
    throwInput("{}: {} must be a number above 0", placeOf(path, *node), key);
  return *value;
}

std::vector<std::string> readSettings(const toml::table& table, const char* key,
                                      const std::string& path) {
  const toml::node* node = table.get(key);
  if (node == nullptr) return {};
  const toml::array* array = node->as_array();
  if (array == nullptr)
    throwInput("{}: {} must be a list of \"key=value\"", placeOf(path, *node), key);
  std::vector<std::string> settings;
  for (const toml::node& element : *array) {
    const auto text = element.value_exact<std::string>();
    if (!text) throwInput("{}: {} must be a list of \"key=value\"", placeOf(path, element), key);
    settings.push_back(*text);
  }
  return settings;
}

AblationRow readRow(const toml::table& table, const std::string& path) {
  checkKeys(table, kRowKeys, path);
  AblationRow row;
  row.where = placeOf(path, table);
  row.name = readText(table, "name", path);
  if (row.name.empty()) throwInput("{}: a row needs a name", row.where);
  row.about = readText(table, "about", path);
  row.params = readText(table, "params", path);
  row.set = readSettings(table, "set", path);
  row.else_set = readSettings(table, "else_set", path);
  row.ray_proxy = readNumber(table, "ray_proxy", path);
  row.vertical = readNumber(table, "vertical", path);
  row.probes = readNumber(table, "probes", path);
  row.clamp_over_mean = readNumber(table, "clamp_over_mean", path);
  row.mode = readText(table, "mode", path);
  if (!row.mode.empty() && std::find(kModes.begin(), kModes.end(), row.mode) == kModes.end())
    throwInput("{}: mode is '{}'{}", row.where, row.mode, suggestion(row.mode, kModes));
  return row;
}

Ablation readAblation(std::string_view text, const std::string& path) {
  const toml::table table = parseToml(text, path);
  checkKeys(table, kFileKeys, path);
  Ablation ablation;
  ablation.about = readText(table, "about", path);
  const toml::array* rows = table.get_as<toml::array>("row");
  if (rows == nullptr || rows->empty()) throwInput("{}: no [[row]]", path);
  std::vector<std::string> names = {"base"};
  for (const toml::node& node : *rows) {
    if (!node.is_table()) throwInput("{}: write rows as [[row]]", placeOf(path, node));
    ablation.rows.push_back(readRow(*node.as_table(), path));
    const AblationRow& row = ablation.rows.back();
    if (std::find(names.begin(), names.end(), row.name) != names.end())
      throwInput("{}: there is a row '{}' already", row.where, row.name);
    names.push_back(row.name);
  }
  return ablation;
}

AblationCase applyRow(const AblationRow& row, const FieldOptions& base) {
  AblationCase result{row, base, {}, ""};
  FieldOptions& options = result.options;
  if (!row.params.empty()) options.params = row.params, options.set.clear();
  if (row.ray_proxy) options.ray_proxy_m = *row.ray_proxy;
  if (row.vertical) options.vertical = *row.vertical;
  if (row.probes)
    options.probes = std::max(1, static_cast<int>(std::lround(base.probes * *row.probes)));
  const std::vector<std::string> before = options.set;
  const auto apply = [&](const std::vector<std::string>& settings) {
    options.set = before;
    options.set.insert(options.set.end(), settings.begin(), settings.end());
    result.row.set = settings;
    result.params = resolveParams(options);
  };
  try {
    apply(row.set);
  } catch (const InputError& error) {
    if (row.else_set.empty()) throwInput("{}: row '{}': {}", row.where, row.name, error.what());
    apply(row.else_set);
  }
  return result;
}

std::string whyNot(const AblationCase& row, const AblationCase& base) {
  if (!row.row.mode.empty() && row.row.mode != base.options.mode)
    return fmt::format("counts in {} mode only", row.row.mode);
  if (!base.options.layout.empty() && (row.row.vertical || row.row.probes))
    return "the layout is given";
  const bool same = describeParams(row.params) == describeParams(base.params) &&
                    row.options.ray_proxy_m == base.options.ray_proxy_m &&
                    row.options.vertical.value_or(1) == base.options.vertical.value_or(1) &&
                    row.options.probes == base.options.probes && !row.row.clamp_over_mean;
  return same ? "changes nothing here" : "";
}

}  // namespace

std::vector<std::string> ablationNames() {
  std::vector<std::string> names;
  for (const EmbeddedFile& file : ablationFiles()) names.emplace_back(file.name);
  return names;
}

Ablation loadAblation(const std::string& name_or_file) {
  Ablation ablation;
  for (const EmbeddedFile& file : ablationFiles())
    if (file.name == name_or_file) {
      ablation = readAblation(file.text, name_or_file + ".toml");
      ablation.name = name_or_file;
      return ablation;
    }
  const std::filesystem::path path = name_or_file;
  if (path.extension() != ".toml")
    throwInput("--ablation: unknown ablation '{}'; there are {} (or name a .toml file)",
               name_or_file, fmt::join(ablationNames(), ", "));
  ablation = readAblation(readTextFile(path), path.string());
  ablation.name = path.stem().string();
  return ablation;
}

std::vector<AblationCase> resolveAblation(const Ablation& ablation, const FieldOptions& base) {
  std::vector<AblationCase> cases = {{AblationRow{}, base, resolveParams(base), ""}};
  cases.front().row.name = "base";
  for (const AblationRow& row : ablation.rows) {
    AblationCase next = applyRow(row, base);
    next.why_not = whyNot(next, cases.front());
    cases.push_back(std::move(next));
  }
  return cases;
}

}  // namespace probelab
