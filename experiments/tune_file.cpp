// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <sstream>

#include "base/build_info.h"
#include "table.h"

namespace probelab {
namespace {

using Values = std::vector<std::pair<std::string, std::string>>;  // key, as in TOML

Values valuesOf(const Params& params) {
  Values values;
  std::istringstream lines(describeParams(params));
  for (std::string line; std::getline(lines, line);)
    if (const std::size_t equals = line.find(" = "); equals != std::string::npos)
      values.emplace_back(line.substr(0, equals), line.substr(equals + 3));
  return values;
}

// The preset that `from` names, else the one that differs from it in the fewest keys.
std::string basePreset(const std::string& from, const Params& params) {
  const std::vector<std::string> presets = presetNames();
  if (std::find(presets.begin(), presets.end(), from) != presets.end()) return from;
  const Values values = valuesOf(params);
  const auto differing = [&](const std::string& preset) {
    const Values other = valuesOf(loadParams(preset));
    std::size_t count = 0;
    for (std::size_t i = 0; i < values.size(); ++i) count += values[i] != other[i];
    return count;
  };
  return *std::min_element(
      presets.begin(), presets.end(),
      [&](const std::string& a, const std::string& b) { return differing(a) < differing(b); });
}

std::vector<std::string> splitShell(const std::string& line) {
  std::vector<std::string> words(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '\'') quoted = !quoted;
    if (c == ' ' && !quoted)
      words.emplace_back();
    else
      words.back() += c;
  }
  return words;
}

std::string stateLines(const TuneOutcome& outcome) {
  TextTable table({"#   scene", "state", "nrmse before", "after", "light leak", "after",
                   "shadow leak", "after"});
  const auto number = [](const std::optional<double>& value) {
    return value ? fmt::format("{:.4f}", *value) : std::string("-");
  };
  for (const PartScore& score : outcome.scores) {
    const ErrorMetrics &from = score.of(kFromSetting).heldout.all,
                       &tuned = score.of(kTunedSetting).heldout.all;
    table.addRow(
        {"#   " + score.part.scene->scene.name,
         score.part.state->scene.state + (score.part.state->tuned_on ? "" : " (not tuned on)"),
         number(from.nrmse), number(tuned.nrmse), number(from.light_leak), number(tuned.light_leak),
         number(from.shadow_leak), number(tuned.shadow_leak)});
  }
  return table.text();
}

std::string header(const TuneOutcome& outcome) {
  const Provenance& p = outcome.provenance;
  std::string text = fmt::format("# Tuned by probelab {}.\n", p.version);
  text += fmt::format("#   {}\n", reproducibleCommand(p.command));
  text += fmt::format("#   seed {}, device {}, tracer {}\n", p.seed, p.device, p.tracer);
  for (const auto& scene : outcome.scenes)
    text +=
        fmt::format("#   {} ({}): layout {} of {} probes, {} receivers\n", scene->scene.name,
                    scene->scene.content_hash.substr(0, 12), scene->layout.strategy,
                    scene->layout.positions.size(), scene->states.front().receivers.points.size());
  if (outcome.tuned.check.folds > 0)
    text += fmt::format("# Step taken: {:g} %, cross-validated on {} folds.\n",
                        100 * outcome.tuned.check.share, outcome.tuned.check.folds);
  text += fmt::format("# On held-out receivers, from {}:\n", outcome.problem.from.name);
  return text + stateLines(outcome);
}

}  // namespace

std::string reproducibleCommand(const std::string& command_line) {
  static const std::vector<std::string> with_value = {
      "-o",      "--output",  "--report",  "--bias-map",  "--bias-map-size",
      "--cache", "--threads", "--require", "--fit-values"};
  static const std::vector<std::string> alone = {"--json", "--quiet", "--validation"};
  const auto is_in = [](const std::vector<std::string>& list, const std::string& word) {
    return std::find(list.begin(), list.end(), word) != list.end();
  };
  std::vector<std::string> kept;
  const std::vector<std::string> words = splitShell(command_line);
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string name = words[i].substr(0, words[i].find('='));
    if (is_in(alone, words[i])) continue;
    if (is_in(with_value, name)) {
      i += name == words[i];
      continue;
    }
    kept.push_back(words[i]);
  }
  return fmt::format("{}", fmt::join(kept, " "));
}

std::string formatTunedFile(const TuneOutcome& outcome, const std::string& from) {
  const std::string preset = basePreset(from, outcome.problem.from);
  std::map<std::string, ParamInfo> infos;
  for (ParamInfo& info : paramTable()) infos[info.key] = info;
  const Values base = valuesOf(loadParams(preset)), before = valuesOf(outcome.problem.from),
               after = valuesOf(outcome.tuned.params);
  std::string text = header(outcome) + fmt::format("preset = \"{}\"\n", preset);
  for (std::size_t i = 0; i < after.size(); ++i) {
    const auto& [key, value] = after[i];
    const bool tuned =
        std::find(outcome.names.begin(), outcome.names.end(), key) != outcome.names.end();
    if (!tuned && value == base[i].second) continue;
    const std::string unit = infos[key].unit.empty() ? "" : infos[key].unit + ", ";
    text += tuned ? fmt::format("{} = {}  # {}was {}\n", key, value, unit, before[i].second)
                  : fmt::format("{} = {}\n", key, value);
  }
  return text;
}

}  // namespace probelab
