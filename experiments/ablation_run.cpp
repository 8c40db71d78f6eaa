// SPDX-License-Identifier: GPL-3.0-or-later
#include "ablation_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/progress.h"
#include "base/timer.h"
#include "table.h"

namespace probelab {
namespace {

constexpr int kRounds = 5, kUpdatesARound = 3;        // the first update of a round warms up
constexpr uint64_t kWorkingSets = uint64_t{1} << 30;  // of all rows' fields together
constexpr uint64_t kLeastWorkingSet = uint64_t{32} << 20;

struct RowTimes {
  std::map<std::string, std::vector<double>> rounds;  // "update_ms" -> [round]
};

struct RowResult {
  const AblationCase* row = nullptr;
  const ProxySetup* proxy = nullptr;
  std::vector<Vec3f> estimates;
  ErrorReport report;
  Json json;
  RowTimes times;
};

// Proxies by their error in metres: rows share them.
class ProxyCache {
 public:
  ProxyCache(const SceneSetup& setup, uint64_t seed) : setup_(setup), seed_(seed) {}
  const ProxySetup* get(double asked_m) {
    auto& proxy = proxies_[asked_m];
    if (!proxy) proxy = makeProxySetup(setup_.scene, setup_.embree, asked_m, seed_);
    return proxy.get();
  }

 private:
  const SceneSetup& setup_;
  uint64_t seed_;
  std::map<double, std::unique_ptr<ProxySetup>> proxies_;
};

RowResult scoreRow(SceneSetup& setup, const AblationCase& row, const ProxySetup* proxy,
                   const Receivers& receivers, ScoredSplit split, const Invocation& invocation) {
  const std::unique_ptr<ProbeField> field =
      makeField(setup, row.params,
                {.options = row.options,
                 .seed = invocation.common.seed,
                 .cache = invocation.common.cache,
                 .proxy = proxy,
                 .accumulate = row.options.mode == "converged"});
  const FieldRun run = runField(*field, row.options, invocation);
  const Counters before = field->counters();
  RowResult result{&row, proxy, queryReceivers(*field, receivers), {}, {}, {}};
  result.report = scoreEstimates(result.estimates, receivers, split);
  const double active = field->states().activeCount();
  result.json = {{"row", row.row.name},
                 {"about", row.row.about},
                 {"set", row.row.set},
                 {"params", row.params.name},
                 {"vertical", row.options.vertical.value_or(1)},
                 {"probes", {{"stored", field->probeCount()}, {"active", active}}},
                 {"rays_per_probe", static_cast<double>(field->workOfUpdate().rays) / active},
                 {"memory", memoryJson(*field)},
                 {"ray_proxy", proxyJson(proxy)},
                 {"updates", run.updates},
                 {"error", toJson(result.report)},
                 {"speed", nullptr},
                 {"ratios", nullptr},
                 {"stability", stabilityJson(before, field->counters())}};
  return result;
}

BlendMode engineMode(const ProbeField& field) {
  return {.hysteresis = static_cast<float>(field.params().hysteresis)};
}

// One round: medians of a few updates and one query.
void timeRound(ProbeField& field, RowTimes& times, int round,
               const std::vector<QueryPoint>& points) {
  std::map<std::string, std::vector<double>> samples;
  const BlendMode mode = engineMode(field);
  for (int i = 0; i < kUpdatesARound; ++i) {
    throwIfInterrupted();
    field.update(static_cast<uint64_t>(round * kUpdatesARound + i), mode, mode);
    if (i == 0) continue;
    samples["update_ms"].push_back(field.updateWallMs());
    for (const auto& [stage, ms] : field.updateStages()) samples[stage + "_ms"].push_back(ms);
  }
  for (const auto& [name, values] : samples) times.rounds[name].push_back(percentile(values, 0.5));
  times.rounds["query_ns_per_point"].push_back(percentile(field.timeQuery(points, 3), 0.5) * 1e6 /
                                               static_cast<double>(points.size()));
}

void timeRows(SceneSetup& setup, std::vector<RowResult>& rows, const Receivers& receivers,
              const Invocation& invocation) {
  const std::vector<QueryPoint> points = timedPoints(receivers);
  const uint64_t working_set =
      std::clamp(kWorkingSets / rows.size(), kLeastWorkingSet, FieldSettings{}.working_set_bytes);
  std::vector<std::unique_ptr<ProbeField>> fields;
  for (const RowResult& row : rows)
    fields.push_back(makeField(setup, row.row->params,
                               {.options = row.row->options,
                                .seed = invocation.common.seed,
                                .cache = invocation.common.cache,
                                .proxy = row.proxy,
                                .accumulate = false,
                                .working_set_bytes = working_set}));
  Progress progress("timing", kRounds, invocation.common.quiet);
  for (int round = 0; round < kRounds; ++round) {
    // Each round starts with another row, so that no row always follows the same one.
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::size_t row = (i + static_cast<std::size_t>(round)) % rows.size();
      timeRound(*fields[row], rows[row].times, round, points);
    }
    progress.update(round + 1);
  }
  progress.finish();
}

// The median over rounds of this row's time over the base's.
Json timeRatio(const RowTimes& times, const RowTimes& base, const std::string& name) {
  const auto ours = times.rounds.find(name), theirs = base.rounds.find(name);
  if (ours == times.rounds.end() || theirs == base.rounds.end()) return nullptr;
  std::vector<double> ratios;
  for (std::size_t i = 0; i < std::min(ours->second.size(), theirs->second.size()); ++i)
    if (theirs->second[i] > 0) ratios.push_back(ours->second[i] / theirs->second[i]);
  return ratios.empty() ? Json(nullptr) : Json(percentile(ratios, 0.5));
}

bool sameBits(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3f)) == 0;
}

void describeTimes(RowResult& row, const RowResult& base) {
  Json speed;
  for (const auto& [name, rounds] : row.times.rounds) speed[name] = percentile(rounds, 0.5);
  row.json["speed"] = speed;
  Json ratios;
  const auto ours = row.report.all.nrmse, theirs = base.report.all.nrmse;
  ratios["nrmse"] = ours && theirs && *theirs > 0 ? Json(*ours / *theirs) : Json(nullptr);
  for (const char* name : {"update_ms", "trace_ms", "query_ns_per_point"})
    ratios[name] = timeRatio(row.times, base.times, name);
  row.json["ratios"] = ratios;
  row.json["same_estimates"] = sameBits(row.estimates, base.estimates);
}

// radiance_clamp relative to the scene's light, which its row cannot know. Empty: no light.
std::optional<AblationCase> withClamp(const AblationCase& row, double mean_reference) {
  AblationCase result = row;
  const double clamp = *row.row.clamp_over_mean * mean_reference / std::numbers::pi;
  if (!(clamp > 0)) return std::nullopt;
  const std::string setting = fmt::format("radiance_clamp={}", clamp);
  setParam(result.params, setting);
  result.row.set.push_back(setting);
  return result;
}

std::string formatRow(const Json& row, const char* section, const char* name) {
  const Json& value = section == nullptr ? row[name] : row[section][name];
  return value.is_null() ? std::string("-") : formatNumber(value.get<double>());
}

std::string formatRatio(const Json& row, const char* name) {
  const Json& value = row["ratios"][name];
  return value.is_null() ? std::string("-") : fmt::format("{:.3f}", value.get<double>());
}

std::string describeSettings(const Json& row) {
  const bool base = row["row"] == "base";
  std::vector<std::string> parts;
  const auto add = [&](const std::string& part) {
    if (!part.empty()) parts.push_back(part);
  };
  add(base ? row["params"].get<std::string>()
           : fmt::format("{}", fmt::join(row["set"].get<std::vector<std::string>>(), " ")));
  add(row["about"].get<std::string>());
  if (!row["ray_proxy"].is_null()) add("ray proxy: " + formatProxy(row["ray_proxy"]));
  return fmt::format("{}", fmt::join(parts, "; "));
}

}  // namespace

Json runAblation(SceneSetup& setup, const std::vector<AblationCase>& cases,
                 const Receivers& receivers, ScoredSplit split, const Invocation& invocation) {
  ProxyCache proxies(setup, invocation.common.seed);
  std::vector<AblationCase> ready;  // filled before anything points into it
  Json skipped = Json::array();
  const auto skip = [&](const AblationCase& row, const std::string& why) {
    skipped.push_back({{"row", row.row.name}, {"why", why}});
  };
  const double mean_reference = meanReference(receivers, split);
  for (const AblationCase& row : cases) {
    if (!row.why_not.empty()) {
      skip(row, row.why_not);
    } else if (!row.row.clamp_over_mean) {
      ready.push_back(row);
    } else if (std::optional<AblationCase> clamped = withClamp(row, mean_reference)) {
      ready.push_back(*clamped);
    } else {
      skip(row, "the scene has no light");
    }
  }
  std::vector<RowResult> rows;
  for (const AblationCase& row : ready) {
    note(invocation, "row {} of {}: {}", &row - ready.data() + 1, ready.size(), row.row.name);
    try {
      const ProxySetup* proxy = proxies.get(row.options.ray_proxy_m);
      rows.push_back(scoreRow(setup, row, proxy, receivers, split, invocation));
    } catch (const Error& error) {
      const bool is_row = &row != ready.data() && error.exitCode() != Interrupted().exitCode();
      if (!is_row) throw;
      skip(row, error.what());
    }
  }
  timeRows(setup, rows, receivers, invocation);
  Json table = Json::array();
  for (RowResult& row : rows) {
    describeTimes(row, rows.front());
    table.push_back(row.json);
  }
  return {{"rounds", kRounds}, {"ablation", table}, {"ablation_skipped", skipped}};
}

std::string formatAblation(const Json& result) {
  TextTable table({"row", "nrmse", "x", "light leak", "shadow leak", "update ms", "x", "trace x",
                   "query ns", "x", "probes", "rays", "bytes", "fallback", ""});
  std::vector<std::pair<std::string, std::string>> legend;
  for (const Json& row : result["ablation"]) {
    const bool base = legend.empty();
    table.addRow(
        {row["row"].get<std::string>(), formatRow(row, "error", "nrmse"), formatRatio(row, "nrmse"),
         formatRow(row, "error", "light_leak"), formatRow(row, "error", "shadow_leak"),
         formatRow(row, "speed", "update_ms"), formatRatio(row, "update_ms"),
         formatRatio(row, "trace_ms"), formatRow(row, "speed", "query_ns_per_point"),
         formatRatio(row, "query_ns_per_point"), formatRow(row, "probes", "active"),
         formatRow(row, nullptr, "rays_per_probe"), formatRow(row, "memory", "atlas_per_probe"),
         formatRow(row, "stability", "fallback_queries"),
         !base && row["same_estimates"].get<bool>() ? "same bytes" : ""});
    legend.emplace_back(row["row"].get<std::string>(), describeSettings(row));
  }
  std::string text = table.text() + "\n" + formatFields(legend);
  for (const Json& row : result["ablation_skipped"])
    text += fmt::format("skipped: {}: {}\n", row["row"].get<std::string>(),
                        row["why"].get<std::string>());
  return text + fmt::format(
                    "\nx: over the base row, of times the median of the ratios within each of {} "
                    "rounds over all rows; "
                    "so it need not equal the ratio of the medians\n",
                    result["rounds"].get<int>());
}

}  // namespace probelab
