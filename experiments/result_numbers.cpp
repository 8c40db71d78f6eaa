// SPDX-License-Identifier: GPL-3.0-or-later
#include "result_numbers.h"

#include <nlohmann/json.hpp>
#include <set>

namespace probelab {
namespace {

using Visit = std::function<void(const std::string& name, const Json& value)>;

// What entries of lists are told apart by, all that they have of these: "room.day" for a score.
constexpr const char* kEntryNames[] = {"name", "key", "setting", "left_out", "scene", "state"};

std::string entryName(const Json& entry) {
  std::string name;
  if (!entry.is_object()) return name;
  for (const char* key : kEntryNames)
    if (const auto found = entry.find(key); found != entry.end() && found->is_string())
      name += (name.empty() ? "" : ".") + found->get<std::string>();
  return name;
}

bool areNamed(const Json& list) {
  std::set<std::string> names;
  for (const Json& entry : list)
    if (const std::string name = entryName(entry); name.empty() || !names.insert(name).second)
      return false;
  return true;
}

void visitUnder(const Json& json, const std::string& name, const Visit& visit) {
  const auto below = [&](const std::string& key, const Json& value) {
    visitUnder(value, name.empty() ? key : name + "." + key, visit);
  };
  if (json.is_object()) {
    for (const auto& [key, value] : json.items())
      if (key != "blocks") below(key, value);
  } else if (json.is_array() && areNamed(json)) {
    for (const Json& entry : json) below(entryName(entry), entry);
  } else if (json.is_number() || json.is_boolean()) {
    visit(name, json);
  }
}

}  // namespace

void visitNumbers(const Json& json, const Visit& visit) { visitUnder(json, "", visit); }

}  // namespace probelab
