// SPDX-License-Identifier: GPL-3.0-or-later
#include "help.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <sstream>
#include <vector>

namespace probelab {
namespace {

constexpr std::size_t kWidth = 80;
constexpr std::size_t kTextColumn = 27;

// `text` broken at spaces so that it fits between the columns `indent` and kWidth; the first line
// starts where the cursor is.
std::string wrapText(const std::string& text, std::size_t indent) {
  std::string out;
  std::size_t column = indent;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (column > indent && column + 1 + word.size() > kWidth) {
      out += "\n" + std::string(indent, ' ');
      column = indent;
    } else if (column > indent) {
      out += ' ';
      ++column;
    }
    out += word;
    column += word.size();
  }
  return out;
}

std::string formatRow(const std::string& name, const std::string& text) {
  std::string row = "  " + name;
  if (text.empty()) return row + "\n";
  if (row.size() + 2 > kTextColumn)
    row += "\n" + std::string(kTextColumn, ' ');
  else
    row.resize(kTextColumn, ' ');
  return row + wrapText(text, kTextColumn) + "\n";
}

bool isFlag(const CLI::Option& option) { return option.get_items_expected_max() == 0; }

// "-o, --output FILE", "    --spp N".
std::string optionName(const CLI::Option& option) {
  if (option.get_positional()) return option.get_name(true);
  std::string name;
  for (const std::string& s : option.get_snames()) name += "-" + s + ", ";
  if (name.empty()) name = "    ";
  const std::vector<std::string>& long_names = option.get_lnames();
  if (long_names.empty())
    name.resize(name.size() - 2);
  else
    name += "--" + long_names.front();
  return isFlag(option) ? name : name + " " + option.get_type_name();
}

std::string optionText(const CLI::Option& option) {
  std::string text = option.get_description();
  if (!option.get_default_str().empty())
    text += fmt::format(" (default: {})", option.get_default_str());
  return text;
}

std::string formatGroup(const std::string& title, const std::vector<const CLI::Option*>& options) {
  std::vector<std::pair<std::string, std::string>> rows;
  for (const CLI::Option* option : options)
    rows.emplace_back(optionName(*option), optionText(*option));
  return formatHelpPart(title, rows);
}

std::string formatUsage(const CLI::App& app, const std::string& full_name) {
  std::string usage = full_name;
  for (const CLI::Option* option : app.get_options()) {
    const std::string name = option->get_name(true);
    if (option->get_positional()) usage += option->get_required() ? " " + name : " [" + name + "]";
  }
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional() || !option->get_required()) continue;
    const bool has_short = !option->get_snames().empty();
    usage += has_short ? " -" + option->get_snames().front() : " --" + option->get_lnames().front();
    if (!isFlag(*option)) usage += " " + option->get_type_name();
  }
  if (!app.get_subcommands(nullptr).empty()) usage += " COMMAND";
  return "Usage: " + usage + " [options]\n";
}

}  // namespace

std::string formatHelpPart(const std::string& title,
                           const std::vector<std::pair<std::string, std::string>>& rows) {
  if (rows.empty()) return "";
  std::string out = "\n" + title + "\n";
  for (const auto& [name, text] : rows) out += formatRow(name, text);
  return out;
}

std::string formatHelp(const CLI::App& app, const std::string& full_name) {
  std::string out = full_name + ": " + app.get_description();
  out = wrapText(out, 0) + "\n\n" + formatUsage(app, full_name);
  const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
  if (!commands.empty()) out += "\nCommands\n";
  for (const CLI::App* command : commands)
    out += formatRow(command->get_name(), command->get_description());

  out += formatGroup("Arguments", app.get_options([](const CLI::Option* option) {
    return option->get_positional();
  }));
  std::vector<std::string> groups = app.get_groups();
  std::stable_partition(groups.begin(), groups.end(),
                        [](const std::string& group) { return group != kCommonGroup; });
  for (const std::string& group : groups) {
    if (group.empty()) continue;
    out += formatGroup(group, app.get_options([&](const CLI::Option* option) {
      return option->get_group() == group && !option->get_positional();
    }));
  }
  if (!app.get_footer().empty()) out += "\nExample\n  " + app.get_footer() + "\n";
  return out;
}

}  // namespace probelab
