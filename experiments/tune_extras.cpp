// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_extras.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/progress.h"

namespace probelab {
namespace {

Json placeJson(const std::string& name, const Params& params) {
  return {{"name", name}, {"normal_bias", params.normal_bias}, {"view_bias", params.view_bias}};
}

// Only where the cost falls, and the last.
Json descentJson(const std::vector<double>& best_after) {
  Json steps = Json::array();
  for (std::size_t i = 0; i < best_after.size(); ++i)
    if (i == 0 || i + 1 == best_after.size() || best_after[i] < best_after[i - 1])
      steps.push_back({i + 1, best_after[i]});
  return steps;
}

}  // namespace

BiasMapResult mapBiases(const HeldFields& held, const Params& from, const Params& tuned, int size,
                        const Invocation& invocation) {
  const std::vector<std::string> names = {"normal_bias", "view_bias"};
  const std::vector<TunedKey> keys = tunedKeys(names, tuned).inner;
  BiasMapResult result;
  Json places = Json::array({placeJson(kFromSetting, from), placeJson(kTunedSetting, tuned)});
  double normal_high = std::max(keys[0].high, from.normal_bias);
  double view_high = std::max(keys[1].high, from.view_bias);
  for (const std::string& name : presetNames()) places.push_back(placeJson(name, loadParams(name)));
  Progress progress("bias map", 1, invocation.common.quiet);
  const BiasMap map = scanBiases(held.objective(tuned), tuned, size, normal_high, view_high,
                                 [&](double done) { progress.update(done); });
  progress.finish();
  result.csv = "normal_bias,view_bias,cost,nrmse,light_leak\n";
  for (int v = 0; v < size; ++v)
    for (int n = 0; n < size; ++n) {
      const auto i = static_cast<std::size_t>(v * size + n);
      result.csv +=
          fmt::format("{:.6g},{:.6g},{:.8g},{:.8g},{:.8g}\n", normal_high * n / (size - 1),
                      view_high * v / (size - 1), map.cost[i], map.nrmse[i], map.light_leak[i]);
    }
  const double least = *std::min_element(map.cost.begin(), map.cost.end());
  result.json = {{"size", size},        {"normal_high", normal_high},     {"view_high", view_high},
                 {"least_cost", least}, {"tuned_cost", held.cost(tuned)}, {"places", places}};
  return result;
}

Json compareSearches(const HeldFields& held, const Params& from, const SolveResult& first,
                     int evaluations, uint64_t seed) {
  const TuneObjective objective = held.objective(from);
  const std::vector<double> start = toCoordinates(objective.keys, from);
  SolveSettings single;
  single.starts = 1, single.candidates = 0, single.seed = seed;
  return {{"levenberg_marquardt", descentJson(solveTuning(objective, single).best_after)},
          {"multi_start", descentJson(first.best_after)},
          {"nelder_mead", descentJson(nelderMead(objective, start, evaluations))},
          {"random", descentJson(randomSearch(objective, evaluations, seed))}};
}

}  // namespace probelab
