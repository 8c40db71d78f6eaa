// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_scores.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "table.h"

namespace probelab {
namespace {

constexpr const char* kNumbers[] = {"nrmse",      "smape",       "bias",
                                    "light_leak", "shadow_leak", "dark_leak"};
constexpr float kBlocksOnDiagonal = 16;
constexpr double kLeastGap = 0.05;  // of the error, for a share of it to mean anything

// Means of logarithms by scene, then over scenes.
std::optional<GainSummary> summarize(const std::vector<PartScore>& scores, bool same_lights,
                                     const std::string& name, const std::vector<std::string>& of) {
  std::map<const TuneScene*, std::vector<double>> logs;
  for (const PartScore& score : scores) {
    if (score.part.state->tuned_on != same_lights) continue;
    std::optional<double> least;
    for (const std::string& setting : of) {
      const std::optional<double> error = score.of(setting).heldout.all.nrmse;
      if (error && (!least || *error < *least)) least = error;
    }
    const std::optional<double> tuned = score.of(kTunedSetting).heldout.all.nrmse;
    if (least && tuned && *least > 0 && *tuned > 0)
      logs[score.part.scene].push_back(std::log(*least / *tuned));
  }
  if (logs.empty()) return std::nullopt;
  GainSummary summary{name, same_lights, 0, INFINITY, 0, static_cast<int>(logs.size())};
  double sum = 0;
  for (const auto& [scene, values] : logs) {
    double mean = 0;
    for (const double value : values) mean += value / static_cast<double>(values.size());
    sum += mean;
    summary.least = std::min(summary.least, std::exp(mean));
    summary.most = std::max(summary.most, std::exp(mean));
  }
  summary.geometric_mean = std::exp(sum / static_cast<double>(logs.size()));
  return summary;
}

const char* lightsName(bool same) { return same ? "train" : "heldout"; }

}  // namespace

HeldoutBlocks::HeldoutBlocks(const Receivers& receivers, const Box3f& bounds)
    : receivers_(receiverColumns(receivers, ScoredSplit::heldout)) {
  blocks_ = spatialBlocks(receivers_.position, bounds);
  names_.resize(static_cast<std::size_t>(blocks_.count));
  const float edge = length(bounds.max - bounds.min) / kBlocksOnDiagonal;
  for (std::size_t i = 0; i < receivers_.position.size(); ++i) {
    const Vec3f p = (receivers_.position[i] - bounds.min) / edge;
    names_[static_cast<std::size_t>(blocks_.block[i])] =
        fmt::format("{},{},{}", std::floor(p.x), std::floor(p.y), std::floor(p.z));
  }
}

std::vector<double> HeldoutBlocks::errors(const std::vector<Vec3f>& estimates) const {
  const std::vector<Vec3f> estimate = receivers_.pick(estimates);
  return blockSquaredErrors(receivers_.samples(estimate), blocks_);
}

Json numbersJson(const ErrorReport& report) {
  const Json all = toJson(report);
  Json json, floors;
  for (const char* name : kNumbers) json[name] = all[name];
  for (const char* name : kNumbers) floors[name] = all["noise_floor"][name];
  json["noise_floor"] = floors;
  return json;
}

Json intervalJson(const std::optional<RatioInterval>& interval) {
  if (!interval) return nullptr;
  return {{"ratio", interval->ratio}, {"low", interval->low}, {"high", interval->high}};
}

const SettingScore& PartScore::of(const std::string& name) const {
  const auto found = std::find_if(settings.begin(), settings.end(),
                                  [&](const SettingScore& score) { return score.name == name; });
  PROBELAB_CHECK(found != settings.end());
  return *found;
}

PartScore scorePart(TuneFields& fields, const TunePart& part,
                    const std::vector<TuneSetting>& settings) {
  PartScore score;
  score.part = part;
  const Receivers& receivers = part.state->receivers;
  const HeldoutBlocks blocks(receivers, part.scene->scene.bounds);
  score.blocks = blocks.names();
  for (const TuneSetting& setting : settings) {
    SettingScore result;
    result.name = setting.name;
    if (setting.name == kFromSetting || setting.name == kTunedSetting)
      result.exact = scoreEstimates(fields.exactEstimates(part, setting.params), receivers,
                                    ScoredSplit::heldout)
                         .all.nrmse;
    const std::vector<Vec3f>& estimates = fields.estimates(part, setting.params);
    result.train = scoreEstimates(estimates, receivers, ScoredSplit::train);
    result.heldout = scoreEstimates(estimates, receivers, ScoredSplit::heldout);
    if (result.heldout.all.nrmse) result.blocks = blocks.errors(estimates);
    score.settings.push_back(std::move(result));
  }
  const std::vector<double>& tuned = score.of(kTunedSetting).blocks;
  for (SettingScore& setting : score.settings)
    if (setting.name != kTunedSetting && !tuned.empty())
      setting.gain = pairedBootstrapRatio(setting.blocks, tuned, 1, tuned.size());
  return score;
}

std::optional<double> gapClosed(const PartScore& score) {
  const SettingScore& from = score.of(kFromSetting);
  const std::optional<double> tuned = score.of(kTunedSetting).heldout.all.nrmse;
  if (!from.heldout.all.nrmse || !from.exact || !tuned) return std::nullopt;
  const double gap = *from.heldout.all.nrmse - *from.exact;
  if (!(gap > kLeastGap * *from.heldout.all.nrmse)) return std::nullopt;
  return (*from.heldout.all.nrmse - *tuned) / gap;
}

std::vector<GainSummary> summarizeGains(const std::vector<PartScore>& scores,
                                        const std::vector<std::string>& presets) {
  std::vector<GainSummary> gains;
  for (const bool same_lights : {true, false}) {
    const auto add = [&](const std::string& name, const std::vector<std::string>& of) {
      if (const auto summary = summarize(scores, same_lights, name, of)) gains.push_back(*summary);
    };
    add(kFromSetting, {kFromSetting});
    for (const std::string& preset : presets) add(preset, {preset});
    if (presets.size() > 1) add("best", presets);
  }
  return gains;
}

Json toJson(const PartScore& score, bool blocks) {
  Json json = {{"scene", score.part.scene->scene.name},
               {"state", score.part.state->scene.state},
               {"lights", lightsName(score.part.state->tuned_on)},
               {"exact_visibility",
                {{"from", optionalNumber(score.of(kFromSetting).exact)},
                 {"tuned", optionalNumber(score.of(kTunedSetting).exact)}}},
               {"gap_closed", optionalNumber(gapClosed(score))},
               {"settings", Json::array()}};
  for (const SettingScore& setting : score.settings) {
    Json row = {{"setting", setting.name},
                {"train", numbersJson(setting.train)},
                {"heldout", numbersJson(setting.heldout)},
                {"gain", intervalJson(setting.gain)}};
    if (blocks) {
      row["blocks"] = Json::object();
      for (std::size_t i = 0; i < setting.blocks.size(); ++i)
        row["blocks"][score.blocks[i]] = setting.blocks[i];
    }
    json["settings"].push_back(std::move(row));
  }
  return json;
}

Json toJson(const GainSummary& summary) {
  return {{"against", summary.against},
          {"lights", lightsName(summary.same_lights)},
          {"geometric_mean", summary.geometric_mean},
          {"least", summary.least},
          {"most", summary.most},
          {"scenes", summary.scenes}};
}

std::string formatScores(const std::vector<PartScore>& scores) {
  std::string text;
  for (const PartScore& score : scores) {
    text += fmt::format("\n{}, {}{}\n", score.part.scene->scene.name, score.part.state->scene.state,
                        score.part.state->tuned_on ? "" : " (light not tuned on)");
    TextTable table({"held-out receivers", "nrmse", "train nrmse", "smape", "light leak",
                     "shadow leak", "over tuned", "95 % interval"});
    const auto add = [&](const std::string& name, const SettingScore& s) {
      const ErrorMetrics& e = s.heldout.all;
      table.addRow({name, formatNumber(e.nrmse), formatNumber(s.train.all.nrmse),
                    formatNumber(e.smape), formatNumber(e.light_leak), formatNumber(e.shadow_leak),
                    s.gain ? fmt::format("{:.3f}", s.gain->ratio) : "",
                    s.gain ? fmt::format("{:.3f} .. {:.3f}", s.gain->low, s.gain->high) : ""});
    };
    for (const SettingScore& setting : score.settings) add(setting.name, setting);
    const ErrorMetrics& floor = score.of(kTunedSetting).heldout.noise_floor;
    table.addRow({"noise floor", formatNumber(floor.nrmse), "", formatNumber(floor.smape),
                  formatNumber(floor.light_leak), formatNumber(floor.shadow_leak), "", ""});
    text += table.text();
    const std::optional<double> closed = gapClosed(score);
    text +=
        fmt::format("with traced visibility: from {}, tuned {}; share of from's gap closed: {}\n",
                    formatNumber(score.of(kFromSetting).exact),
                    formatNumber(score.of(kTunedSetting).exact),
                    closed ? fmt::format("{:.0f} %", 100 * *closed) : "-");
  }
  return text;
}

std::string formatGains(const std::vector<GainSummary>& gains) {
  TextTable table(
      {"nrmse over that of tuned", "lights", "geometric mean", "least scene", "most", "scenes"});
  for (const GainSummary& gain : gains)
    table.addRow({gain.against == "best" ? "best of the presets" : gain.against,
                  gain.same_lights ? "tuned on" : "held out",
                  fmt::format("{:.3f}", gain.geometric_mean), fmt::format("{:.3f}", gain.least),
                  fmt::format("{:.3f}", gain.most), std::to_string(gain.scenes)});
  return table.text();
}

}  // namespace probelab
