// SPDX-License-Identifier: GPL-3.0-or-later
#include "report_studies.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/files.h"
#include "result_numbers.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

// What the tables show at first, and how they call it.
struct KnownColumn {
  const char *name, *label, *unit, *about;
};
constexpr KnownColumn kMain[] = {
    {"error.nrmse", "nrmse", "1",
     "root of the mean squared error over the mean square of the reference"},
    {"error.noise_floor.nrmse", "nrmse floor", "1", "the reference's own noise as nrmse"},
    {"error.smape", "smape", "1", "mean of 2 |E - R| / (|E| + R), E estimate, R reference"},
    {"error.bias", "bias", "1", "mean of E - R over the mean of R; below 0: too dark"},
    {"error.light_leak", "light leak", "1",
     "light too much where R is below a tenth of its mean, over that mean"},
    {"error.shadow_leak", "shadow leak", "1",
     "light too little where R is above a tenth of its mean, over that mean"},
    {"temporal.flicker", "flicker", "1", "standard deviation over mean, from update to update"},
    {"temporal.updates_to_95", "to 95 %", "updates", "updates to 95 % of a step"},
    {"speed.frame_ms", "frame", "ms", "an update and the queries of a 1080p frame"},
    {"speed.update_ms", "update", "ms", "an update of the field"},
    {"probes.stored", "probes stored", "probes", "probes that own texels"},
    {"memory_bytes", "memory", "bytes", "texels, states and index"},
    {"seconds", "run time", "s", "wall clock of the whole run"}};

// "layout_build_s" is in seconds.
std::string unitOf(const std::string& name) {
  constexpr std::pair<const char*, const char*> kEndings[] = {
      {"_ms", "ms"},      {"_s", "s"},       {"seconds", "s"},      {"_m", "m"},
      {"bytes", "bytes"}, {"_per_s", "1/s"}, {"ns_per_point", "ns"}};
  std::string unit = name.starts_with("memory.") ? "bytes" : "";
  for (const auto& [ending, text] : kEndings)
    if (name.ends_with(ending)) unit = text;
  return unit;
}

using NamedTexts = std::vector<std::pair<std::string, std::string>>;

NamedTexts::const_iterator findNamed(const NamedTexts& texts, const std::string& name) {
  return std::ranges::find_if(texts, [&](const auto& text) { return text.first == name; });
}

struct Cell {
  std::string id, command;
  NamedTexts axes, provenance;
  std::map<std::string, Json> numbers;
};

std::string plainText(const Json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

// Throws InputError unless the file is a result of `probelab run`.
Cell readCellFile(const fs::path& path, std::vector<std::string>& columns) {
  Json json = Json::parse(readTextFile(path), nullptr, false);
  const bool whole = json.is_object() && json.contains("cell") && json["cell"].is_object() &&
                     json["cell"].contains("axes") && json["cell"]["axes"].is_object();
  if (!whole) throwInput("no result of 'probelab run'; delete the file and run the study again");
  Cell cell;
  cell.id = path.stem().string();
  for (const auto& [name, value] : json["cell"]["axes"].items()) {
    if (!value.is_string())
      throwInput("axis '{}' is no text; delete the file and run the study again", name);
    cell.axes.emplace_back(name, value.get<std::string>());
  }
  const Json provenance = json.value("provenance", Json::object());
  for (const char* name : {"version", "device", "driver", "tracer", "compiler", "build_type"})
    if (provenance.is_object() && provenance.contains(name))
      cell.provenance.emplace_back(name, plainText(provenance[name]));
  if (provenance.is_object() && provenance.contains("command"))
    cell.command = plainText(provenance["command"]);
  json["seconds"] = json["cell"].value("seconds", Json());
  for (const char* left_out : {"cell", "provenance", "params", "seed"}) json.erase(left_out);
  visitNumbers(json, [&](const std::string& name, const Json& value) {
    if (std::find(columns.begin(), columns.end(), name) == columns.end()) columns.push_back(name);
    cell.numbers[name] = value;
  });
  return cell;
}

std::string lastLine(const fs::path& log) {
  std::string text = readTextFile(log);
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  return text.substr(text.find_last_of('\n') + 1);
}

Json columnsJson(const std::vector<std::string>& axes, const std::vector<std::string>& numbers,
                 std::vector<std::string>& order) {
  Json columns = Json::array();
  for (const std::string& axis : axes)
    columns.push_back({{"name", axis},
                       {"label", axis},
                       {"unit", ""},
                       {"about", "axis of the study"},
                       {"kind", "axis"},
                       {"main", true}});
  for (const KnownColumn& known : kMain) {
    if (std::find(numbers.begin(), numbers.end(), known.name) == numbers.end()) continue;
    order.push_back(known.name);
    columns.push_back({{"name", known.name},
                       {"label", known.label},
                       {"unit", known.unit},
                       {"about", known.about},
                       {"kind", "number"},
                       {"main", true}});
  }
  for (const std::string& name : numbers) {
    if (std::find(order.begin(), order.end(), name) != order.end()) continue;
    order.push_back(name);
    columns.push_back({{"name", name},
                       {"label", name},
                       {"unit", unitOf(name)},
                       {"about", ""},
                       {"kind", "number"},
                       {"main", false}});
  }
  return columns;
}

Json rowsJson(const std::vector<Cell>& cells, const std::vector<std::string>& axes,
              const std::vector<std::string>& numbers) {
  Json rows = Json::array();
  for (const Cell& cell : cells) {
    Json values = Json::array();
    for (const std::string& axis : axes) {
      const auto found = findNamed(cell.axes, axis);
      values.push_back(found == cell.axes.end() ? Json(nullptr) : Json(found->second));
    }
    for (const std::string& name : numbers) {
      const auto found = cell.numbers.find(name);
      values.push_back(found == cell.numbers.end() ? Json(nullptr) : found->second);
    }
    rows.push_back({{"id", cell.id}, {"values", values}, {"command", cell.command}});
  }
  return rows;
}

// Every value there is of each kind, with counts where there are several.
Json provenanceJson(const std::vector<Cell>& cells) {
  std::vector<std::string> names;
  std::map<std::string, std::map<std::string, int>> found;
  for (const Cell& cell : cells)
    for (const auto& [name, value] : cell.provenance) {
      if (!found.contains(name)) names.push_back(name);
      ++found[name][value];
    }
  Json json = Json::array();
  for (const std::string& name : names)
    for (const auto& [value, count] : found[name])
      json.push_back({name, found[name].size() == 1
                                ? value
                                : fmt::format("{} ({} of {} cells)", value, count, cells.size())});
  return json;
}

// Cells of several versions or devices are no repetitions: what differs becomes a column.
void tellApart(std::vector<Cell>& cells) {
  for (const char* name : {"version", "device"}) {
    std::vector<std::string> values;
    for (const Cell& cell : cells) {
      const auto found = findNamed(cell.provenance, name);
      values.push_back(found == cell.provenance.end() ? "" : found->second);
    }
    const bool same =
        std::ranges::adjacent_find(values, std::ranges::not_equal_to()) == values.end();
    for (std::size_t i = 0; i < cells.size(); ++i)
      if (!same && findNamed(cells[i].axes, name) == cells[i].axes.end())
        cells[i].axes.emplace_back(name, values[i]);
  }
}

Json studyJson(const fs::path& folder) {
  std::vector<Cell> cells;
  std::vector<std::string> axes, numbers, order;
  Json failures = Json::array();
  for (const fs::path& file : filesIn(folder / "cells", {".json"})) {
    if (file.filename().string().starts_with(".")) continue;
    try {
      cells.push_back(readCellFile(file, numbers));
    } catch (const InputError& error) {
      failures.push_back(
          {{"id", file.stem().string()},
           {"error", fmt::format("{}: {}", file.filename().string(), error.what())}});
    }
  }
  tellApart(cells);
  for (const Cell& cell : cells)
    for (const auto& [name, value] : cell.axes)
      if (std::find(axes.begin(), axes.end(), name) == axes.end()) axes.push_back(name);
  for (const fs::path& log : filesIn(folder / "logs", {".txt"})) {
    std::error_code ec;
    const std::string id = log.stem().string();
    if (!fs::exists(folder / "cells" / (id + ".json"), ec))
      failures.push_back({{"id", id}, {"error", "no result; its log ends: " + lastLine(log)}});
  }
  const fs::path plain = plainPath(folder);
  Json json = {{"name", plain.filename().string()}, {"provenance", provenanceJson(cells)}};
  json["columns"] = columnsJson(axes, numbers, order);
  json["rows"] = rowsJson(cells, axes, order);
  json["failures"] = failures;
  return json;
}

template <class Wanted>
std::vector<fs::path> entriesOf(const fs::path& folder, const Wanted& wanted) {
  std::vector<fs::path> entries;
  std::error_code ec;
  if (!fs::exists(folder, ec) && !ec) return entries;
  for (fs::directory_iterator at(folder, ec), end; !ec && at != end; at.increment(ec))
    if (wanted(*at)) entries.push_back(at->path());
  if (ec) throwInput("{}: cannot be read: {}", folder.string(), ec.message());
  std::sort(entries.begin(), entries.end());
  return entries;
}

}  // namespace

std::vector<fs::path> filesIn(const fs::path& folder, const std::vector<std::string>& extensions) {
  return entriesOf(folder, [&](const fs::directory_entry& entry) {
    const std::string extension = entry.path().extension().string();
    return entry.is_regular_file() &&
           std::find(extensions.begin(), extensions.end(), extension) != extensions.end();
  });
}

std::vector<fs::path> foldersIn(const fs::path& folder) {
  return entriesOf(folder, [](const fs::directory_entry& entry) { return entry.is_directory(); });
}

Json reportStudies(const fs::path& folder) {
  Json studies = Json::array();
  if (isFolder(folder / "cells")) {
    studies.push_back(studyJson(folder));
    return studies;
  }
  for (const fs::path& inner : foldersIn(folder))
    if (isFolder(inner / "cells")) studies.push_back(studyJson(inner));
  return studies;
}

}  // namespace probelab
