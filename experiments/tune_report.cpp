// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/build_info.h"
#include "field_setup.h"
#include "layout_json.h"
#include "table.h"

namespace probelab {
namespace {

constexpr double kNearBest = 1.01;  // cost of a start that found the optimum, over the least

Json finiteJson(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

std::string unitOf(const std::string& key) {
  for (const ParamInfo& info : paramTable())
    if (info.key == key) return info.unit;
  return "";
}

Json parametersJson(const TuneOutcome& outcome) {
  const KeySplit& keys = outcome.problem.keys;
  const SolveResult& local = outcome.tuned.local;
  Json list = Json::array();
  const auto add = [&](const std::string& key, double low, double high) {
    list.push_back({{"key", key},
                    {"unit", unitOf(key)},
                    {"low", low},
                    {"high", high},
                    {"from", paramValue(outcome.problem.from, key)},
                    {"tuned", paramValue(outcome.tuned.params, key)}});
  };
  for (std::size_t i = 0; i < keys.inner.size(); ++i) {
    add(keys.inner[i].name, keys.inner[i].low, keys.inner[i].high);
    list.back()["optimum"] = keyValue(keys.inner[i], local.x[i]);
    list.back()["sensitivity"] = finiteJson(local.sensitivity[i]);
    list.back()["standard_deviation"] = finiteJson(local.standard_deviations[i]);
  }
  for (const OuterKey& key : keys.outer) {
    add(key.name, key.low, key.high);
    for (const char* name : {"optimum", "sensitivity", "standard_deviation"})
      list.back()[name] = nullptr;
  }
  return list;
}

Json correlationJson(const SolveResult& local) {
  Json rows = Json::array();
  for (const std::vector<double>& row : local.correlation) {
    Json numbers = Json::array();
    for (const double value : row) numbers.push_back(finiteJson(value));
    rows.push_back(numbers);
  }
  return rows;
}

// Paths of the multi-start solution: values of the keys and cost, a step each.
Json startsJson(const TuneOutcome& outcome) {
  Json list = Json::array();
  for (const SolvePath& path : outcome.tuned.first.paths) {
    Json steps = Json::array();
    for (const SolveStep& step : path.steps) {
      Json values = Json::array();
      for (std::size_t i = 0; i < step.x.size(); ++i)
        values.push_back(keyValue(outcome.problem.keys.inner[i], step.x[i]));
      steps.push_back({{"values", values}, {"cost", step.cost}});
    }
    list.push_back({{"ended", path.ended}, {"evaluations", path.evaluations}, {"steps", steps}});
  }
  return list;
}

Json roundsJson(const Tuned& tuned) {
  Json list = Json::array();
  for (const TuneRound& round : tuned.rounds)
    list.push_back({{"before", round.before},
                    {"solved", round.solved},
                    {"after", round.after},
                    {"step", round.step},
                    {"moved", round.moved}});
  return list;
}

// Null where nothing was checked.
Json checkJson(const StepCheck& check) {
  if (check.folds == 0) return nullptr;
  return {{"folds", check.folds},
          {"shares", kStepShares},
          {"costs", check.costs},
          {"fold_costs", check.fold_costs},
          {"share", check.share}};
}

Json outerJson(const TuneOutcome& outcome) {
  Json list = Json::array();
  for (const OuterStep& step : outcome.tuned.outer) {
    Json values;
    for (std::size_t i = 0; i < step.values.size(); ++i)
      values[outcome.problem.keys.outer[i].name] = step.values[i];
    list.push_back({{"values", values}, {"cost", finiteJson(step.cost)}, {"kept", step.kept}});
  }
  return list;
}

Json scenesJson(const TuneOutcome& outcome) {
  Json list = Json::array();
  for (const auto& scene : outcome.scenes) {
    Json states = Json::array();
    for (const TuneState& state : scene->states)
      states.push_back(
          {{"name", state.scene.state}, {"lights", state.tuned_on ? "train" : "heldout"}});
    list.push_back({{"scene", scene->scene.name},
                    {"hash", scene->scene.content_hash},
                    {"states", states},
                    {"receivers", scene->states.front().receivers.points.size()},
                    {"strategy", scene->layout.strategy},
                    {"probes", {{"stored", scene->layout.positions.size()}}},
                    {"lattice", latticeJson(scene->layout)},
                    {"layout", layoutJson(scene->layout)},
                    {"ray_proxy", proxyJson(scene->proxy.get())}});
  }
  return list;
}

Json scoresJson(const std::vector<PartScore>& scores, bool blocks) {
  Json list = Json::array();
  for (const PartScore& score : scores) list.push_back(toJson(score, blocks));
  return list;
}

Json gainsJson(const std::vector<PartScore>& scores, const std::vector<std::string>& presets) {
  Json list = Json::array();
  for (const GainSummary& gain : summarizeGains(scores, presets)) list.push_back(toJson(gain));
  return list;
}

Json foldsJson(const TuneOutcome& outcome, bool blocks) {
  Json list = Json::array();
  for (const TuneFold& fold : outcome.folds) {
    Json values;
    for (const std::string& name : outcome.names)
      values[name] = paramValue(fold.tuned.params, name);
    list.push_back({{"left_out", fold.scene->scene.name},
                    {"values", values},
                    {"cost", {{"from", fold.tuned.cost_from}, {"tuned", fold.tuned.cost}}},
                    {"rounds", roundsJson(fold.tuned)},
                    {"step_check", checkJson(fold.tuned.check)},
                    {"scores", scoresJson(fold.scores, blocks)}});
  }
  return list;
}

std::vector<PartScore> foldScores(const TuneOutcome& outcome) {
  std::vector<PartScore> scores;
  for (const TuneFold& fold : outcome.folds)
    scores.insert(scores.end(), fold.scores.begin(), fold.scores.end());
  return scores;
}

// Geometric means under the lights that were tuned on, for --require.
Json summaryJson(const std::vector<PartScore>& scores, const std::vector<std::string>& presets) {
  Json summary = {{"gain_from", nullptr}, {"gain_best", nullptr}};
  for (const GainSummary& gain : summarizeGains(scores, presets)) {
    if (!gain.same_lights) continue;
    if (gain.against == kFromSetting) summary["gain_from"] = gain.geometric_mean;
    if (gain.against == "best" || (presets.size() == 1 && gain.against == presets.front()))
      summary["gain_best"] = gain.geometric_mean;
  }
  return summary;
}

std::string formatParameters(const TuneOutcome& outcome) {
  TextTable table(
      {"parameter", "from", "tuned", "optimum", "std dev", "sensitivity", "range", "unit"});
  const auto cell = [](const Json& value) {
    return value.is_null() ? std::string("-") : formatNumber(value.get<double>());
  };
  for (const Json& p : parametersJson(outcome))
    table.addRow({p["key"].get<std::string>(), cell(p["from"]), cell(p["tuned"]),
                  cell(p["optimum"]), cell(p["standard_deviation"]), cell(p["sensitivity"]),
                  fmt::format("{:g} .. {:g}", p["low"].get<double>(), p["high"].get<double>()),
                  p["unit"].get<std::string>()});
  return table.text();
}

std::string formatRounds(const Tuned& tuned) {
  TextTable table(
      {"round", "cost before", "solved, field held", "field run again", "kept", "moved"});
  for (const TuneRound& round : tuned.rounds)
    table.addRow({std::to_string(&round - tuned.rounds.data() + 1), formatNumber(round.before),
                  formatNumber(round.solved), formatNumber(round.after),
                  fmt::format("{:g} %", 100 * round.step),
                  fmt::format("{:.1f} %", 100 * round.moved)});
  return table.text();
}

std::string formatStarts(const SolveResult& first) {
  if (first.paths.empty()) return "-";
  const auto polish = first.paths.end() - 1;  // of the best start
  const auto near = std::count_if(first.paths.begin(), polish, [&](const SolvePath& path) {
    return path.steps.back().cost <= kNearBest * first.cost;
  });
  return fmt::format("{}, of which {} end within 1 % of the least cost, {}; {} evaluations",
                     polish - first.paths.begin(), near, formatNumber(first.cost),
                     first.evaluations);
}

std::string formatScenes(const TuneOutcome& outcome) {
  std::vector<std::string> texts;
  for (const auto& scene : outcome.scenes) {
    std::vector<std::string> states;
    for (const TuneState& state : scene->states)
      if (state.tuned_on) states.push_back(state.scene.state);
    texts.push_back(fmt::format("{} ({})", scene->scene.name, fmt::join(states, ", ")));
  }
  return fmt::format("{}", fmt::join(texts, "; "));
}

// "grid, 52 and 61 probes": a number a scene.
std::string formatLayouts(const TuneOutcome& outcome) {
  std::vector<std::string> counts;
  for (const auto& scene : outcome.scenes)
    counts.push_back(std::to_string(scene->layout.positions.size()));
  return fmt::format("{}, {} probes", outcome.scenes.front()->layout.strategy,
                     fmt::join(counts, " and "));
}

std::string formatReceivers(const TuneOutcome& outcome) {
  std::vector<std::string> counts;
  for (const auto& scene : outcome.scenes)
    for (const TuneState& state : scene->states) {
      const std::string count = std::to_string(state.receivers.points.size());
      if (std::ranges::find(counts, count) == counts.end()) counts.push_back(count);
    }
  return fmt::format("{} a state", fmt::join(counts, " or "));
}

std::string formatSettled(const TuneOutcome& outcome) {
  const Tuned& t = outcome.tuned;
  if (outcome.names.empty()) return "nothing was to be tuned";
  if (outcome.problem.keys.inner.empty()) return "no rounds: the parameters change the atlases";
  const char* plural = t.rounds.size() == 1 ? "" : "s";
  return t.settled ? fmt::format("after {} round{}", t.rounds.size(), plural)
                   : fmt::format("no: --rounds {} were used up", t.rounds.size());
}

// "25 %, cross-validated on 4 folds: cost 0.0321 with none of it, 0.0319 with 25 %, 0.0326 with
// all".
std::string formatCheck(const TuneOutcome& outcome) {
  const StepCheck& check = outcome.tuned.check;
  if (outcome.problem.keys.inner.empty()) return "-";
  if (check.folds == 0) return "all of it, without cross-validation";
  const auto at = std::ranges::find(kStepShares, check.share) - std::begin(kStepShares);
  const std::string percent = fmt::format("{:g} %", 100 * check.share);
  const std::string there = fmt::format(
      ", {} with {}", formatNumber(check.costs[static_cast<std::size_t>(at)]), percent);
  return fmt::format("{}, cross-validated on {} folds: cost {} with none of it{}, {} with all",
                     percent, check.folds, formatNumber(check.costs.front()),
                     check.share > 0 && check.share < 1 ? there : "",
                     formatNumber(check.costs.back()));
}

std::string formatFolds(const TuneOutcome& outcome) {
  std::vector<std::string> header = {"without"};
  header.insert(header.end(), outcome.names.begin(), outcome.names.end());
  TextTable table(header);
  for (const TuneFold& fold : outcome.folds) {
    std::vector<std::string> row = {fold.scene->scene.name};
    for (const std::string& name : outcome.names)
      row.push_back(formatNumber(paramValue(fold.tuned.params, name)));
    table.addRow(row);
  }
  return fmt::format("\nleave-one-out: tuned on the others, scored on the one left out\n{}\n{}",
                     table.text(),
                     formatGains(summarizeGains(foldScores(outcome), outcome.presets)));
}

}  // namespace

double paramValue(const Params& params, const std::string& key) {
  return toJson(params)[key].get<double>();
}

Json toJson(const TuneOutcome& o, bool blocks) {
  const Tuned& t = o.tuned;
  Json result = {{"scenes", scenesJson(o)},
                 {"from", o.problem.from.name},
                 {"parameters", parametersJson(o)},
                 {"singular_values", t.local.singular_values},
                 {"correlation", correlationJson(t.local)},
                 {"cost", {{"from", t.cost_from}, {"tuned", t.cost}}},
                 {"settled", t.settled},
                 {"rounds", roundsJson(t)},
                 {"step_check", checkJson(t.check)},
                 {"outer", outerJson(o)},
                 {"outer_kept", t.outer_kept},
                 {"starts", startsJson(o)},
                 {"best_start", t.first.best},
                 {"evaluations", t.evaluations},
                 {"gradients", t.gradients},
                 {"error", nullptr},
                 {"summary", summaryJson(o.scores, o.presets)},
                 {"gains", gainsJson(o.scores, o.presets)},
                 {"scores", scoresJson(o.scores, blocks)},
                 {"leave_one_out", nullptr},
                 {"params", toJson(t.params)}};
  if (!o.scores.empty())
    for (const Json& row : result["scores"][0]["settings"])
      if (row["setting"] == kTunedSetting) result["error"] = row["heldout"];
  if (!o.folds.empty())
    result["leave_one_out"] = {{"summary", summaryJson(foldScores(o), o.presets)},
                               {"gains", gainsJson(foldScores(o), o.presets)},
                               {"folds", foldsJson(o, blocks)}};
  return result;
}

Json tuneOutline() {
  Json outline = {{"cost", {{"from", 0}, {"tuned", 0}}},
                  {"error", Json::object()},
                  {"summary", {{"gain_from", 0}, {"gain_best", 0}}},
                  {"evaluations", 0},
                  {"gradients", 0},
                  {"leave_one_out", {{"summary", {{"gain_from", 0}, {"gain_best", 0}}}}},
                  {"values", Json::object()},
                  {"seconds", {{"solve", 0}, {"fields", 0}, {"all", 0}}}};
  for (const char* name : {"nrmse", "smape", "bias", "light_leak", "shadow_leak", "dark_leak"})
    outline["error"][name] = 0;
  return outline;
}

std::string formatOutcome(const TuneOutcome& o) {
  const Tuned& t = o.tuned;
  std::string text = formatFields(
      {{"scenes", formatScenes(o)},
       {"from", o.problem.from.name},
       {"layout", formatLayouts(o)},
       {"receivers", formatReceivers(o)},
       {"device", fmt::format("{}, tracer {}", o.provenance.device, o.provenance.tracer)},
       {"starts", formatStarts(t.first)},
       {"step taken", formatCheck(o)},
       {"settled", formatSettled(o)}});
  if (!t.rounds.empty()) text += "\n" + formatRounds(t);
  if (!o.names.empty()) text += "\n" + formatParameters(o);
  text += formatScores(o.scores);
  if (!o.scores.empty()) text += "\n" + formatGains(summarizeGains(o.scores, o.presets));
  if (!o.folds.empty()) text += formatFolds(o);
  return text;
}

}  // namespace probelab
