// SPDX-License-Identifier: GPL-3.0-or-later
#include "require.h"

#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/suggest.h"
#include "json.h"

namespace probelab {
namespace {

// Longer operators first, so that "<=" is not read as "<".
constexpr std::array<std::pair<const char*, Comparison>, 5> kOperators = {{
    {"<=", Comparison::less_equal},
    {">=", Comparison::greater_equal},
    {"==", Comparison::equal},
    {"<", Comparison::less},
    {">", Comparison::greater},
}};

constexpr const char* kSections[] = {"", "error.", "speed."};

std::string operatorText(Comparison comparison) {
  for (const auto& [text, value] : kOperators)
    if (value == comparison) return text;
  return "";
}

bool holds(double measured, Comparison comparison, double wanted) {
  switch (comparison) {
    case Comparison::less_equal:
      return measured <= wanted;
    case Comparison::less:
      return measured < wanted;
    case Comparison::greater_equal:
      return measured >= wanted;
    case Comparison::greater:
      return measured > wanted;
    case Comparison::equal:
      return measured == wanted;
  }
  return false;
}

// Dotted path -> value, for every number, null and truth value.
void flatten(const Json& json, const std::string& prefix,
             std::vector<std::pair<std::string, Json>>& out) {
  if (json.is_object() || json.is_array()) {
    for (const auto& [key, value] : json.items())
      flatten(value, prefix.empty() ? key : prefix + "." + key, out);
  } else if (!json.is_string()) {
    out.emplace_back(prefix, json);
  }
}

// Without the section that need not be written.
std::string shortName(const std::string& path) {
  for (const std::string section : {"error.", "speed."})
    if (path.rfind(section, 0) == 0) return path.substr(section.size());
  return path;
}

double measuredValue(const std::string& name, const Json& result) {
  std::vector<std::pair<std::string, Json>> values;
  flatten(result, "", values);
  for (const char* section : kSections)
    for (const auto& [path, value] : values) {
      if (path != section + name) continue;
      if (!value.is_number())
        throwInput("--require: '{}' is {} in this result, so it cannot be compared", path,
                   value.dump());
      return value.get<double>();
    }
  std::vector<std::string> names;
  for (const auto& [path, value] : values)
    if (value.is_number()) names.push_back(shortName(path));
  throwInput("--require: the result has no number '{}'{}", name, suggestion(name, names));
}

// Whether the dotted path leads to a value of the outline, or below an empty part of it.
bool isInOutline(const std::string& path, const Json& outline) {
  if (outline.is_object() || outline.is_array()) {
    if (outline.empty()) return true;
    const std::size_t dot = path.find('.');
    const std::string key = path.substr(0, dot);
    const std::string rest = dot == std::string::npos ? "" : path.substr(dot + 1);
    for (const auto& [name, value] : outline.items())
      if (name == key && isInOutline(rest, value)) return true;
    return false;
  }
  return path.empty() && !outline.is_string();
}

}  // namespace

Requirement parseRequirement(const std::string& text) {
  for (const auto& [symbol, comparison] : kOperators) {
    const std::size_t at = text.find(symbol);
    if (at == std::string::npos) continue;
    const std::string name = CLI::detail::trim_copy(text.substr(0, at));
    const std::string number = CLI::detail::trim_copy(text.substr(at + std::string(symbol).size()));
    char* end = nullptr;
    const double wanted = std::strtod(number.c_str(), &end);
    if (!name.empty() && !number.empty() && *end == '\0' && std::isfinite(wanted))
      return {name, comparison, wanted};
    break;
  }
  throwInput(
      "--require '{}': write NAME OPERATOR NUMBER with <=, <, >=, > or ==, as in "
      "'nrmse<=0.05'",
      text);
}

void addRequireOption(CLI::App& app, std::vector<std::string>& texts) {
  app.add_option("--require", texts,
                 "exit with 3 unless this number of the JSON is within a bound, as in "
                 "'nrmse<=0.05'; with <=, <, >=, > or ==; may be repeated")
      ->type_name("COND")
      ->allow_extra_args(false)
      ->group("Output")
      ->check([](const std::string& text) {
        parseRequirement(text);
        return std::string();
      });
}

void checkRequirements(const std::vector<std::string>& texts, const Json& result) {
  std::vector<std::string> failures;
  for (const std::string& text : texts) {
    const Requirement requirement = parseRequirement(text);
    const double measured = measuredValue(requirement.name, result);
    if (!holds(measured, requirement.comparison, requirement.wanted))
      failures.push_back(fmt::format("{}: wanted {} {:g}, measured {:.9g}", requirement.name,
                                     operatorText(requirement.comparison), requirement.wanted,
                                     measured));
  }
  if (!failures.empty())
    throw RequirementNotMet(fmt::format("not met: {}", fmt::join(failures, "; ")));
}

void checkRequirementNames(const std::vector<std::string>& texts, const Json& outline) {
  for (const std::string& text : texts) {
    const std::string name = parseRequirement(text).name;
    bool known = false;
    for (const char* section : kSections) known = known || isInOutline(section + name, outline);
    if (known) continue;
    std::vector<std::pair<std::string, Json>> values;
    flatten(outline, "", values);
    std::vector<std::string> names;
    for (const auto& [path, value] : values) names.push_back(shortName(path));
    throwInput("--require: the result has no number '{}'{}", name, suggestion(name, names));
  }
}

void reportResult(const Invocation& invocation, const Json& result,
                  const std::function<void()>& print_text) {
  if (invocation.common.json)
    printJson(result);
  else
    print_text();
  checkRequirements(invocation.common.require, result);
}

}  // namespace probelab
