// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_values.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "evaluation.h"
#include "table.h"
#include "tune_scores.h"

namespace probelab {
namespace {

Json pairJson(const ErrorReport& before, const ErrorReport& after) {
  return {{"before", numbersJson(before)}, {"after", numbersJson(after)}};
}

ValuesScore scoreValues(ProbeField& field, const TunePart& part, const TexelValues& values) {
  ValuesScore score;
  const Receivers& receivers = part.state->receivers;
  score.state = part.state->scene.state;
  const HeldoutBlocks blocks(receivers, part.scene->scene.bounds);
  const std::vector<Vec3f> before = queryReceivers(field, receivers);
  applyValues(field, values);
  const std::vector<Vec3f> after = queryReceivers(field, receivers);
  score.train_before = scoreEstimates(before, receivers, ScoredSplit::train);
  score.train_after = scoreEstimates(after, receivers, ScoredSplit::train);
  score.heldout_before = scoreEstimates(before, receivers, ScoredSplit::heldout);
  score.heldout_after = scoreEstimates(after, receivers, ScoredSplit::heldout);
  if (score.heldout_after.all.nrmse)
    score.gain =
        pairedBootstrapRatio(blocks.errors(before), blocks.errors(after), 1, blocks.names().size());
  return score;
}

}  // namespace

FittedValues fitFieldValues(TuneFields& fields, const TuneScene& scene, const Params& params) {
  FittedValues result;
  for (const TuneState& state : scene.states) {
    const TunePart part{&scene, &state};
    const std::unique_ptr<ProbeField> field = fields.run(part, params);
    if (result.scores.empty()) {
      const FieldSnapshot traced = takeSnapshot(*field);
      result.fit = fitValues(traced, state.receivers, Split::train, params, {});
      result.values = makeValues(*field, state.receivers, traced.irradiance, result.fit.irradiance);
    }
    result.scores.push_back(scoreValues(*field, part, result.values));
    result.scores.back().fitted = result.scores.size() == 1;
  }
  return result;
}

Json toJson(const FittedValues& fitted) {
  Json scores = Json::array();
  for (const ValuesScore& score : fitted.scores)
    scores.push_back({{"state", score.state},
                      {"fitted", score.fitted},
                      {"train", pairJson(score.train_before, score.train_after)},
                      {"heldout", pairJson(score.heldout_before, score.heldout_after)},
                      {"gain", intervalJson(score.gain)}});
  return {{"state", fitted.values.state},
          {"texels", fitted.fit.texels},
          {"iterations", fitted.fit.iterations},
          {"scores", scores}};
}

std::string formatValues(const FittedValues& fitted) {
  TextTable table({"texels fitted", "train nrmse", "fitted", "held-out nrmse", "fitted",
                   "before over after", "95 % interval"});
  for (const ValuesScore& s : fitted.scores)
    table.addRow({s.state + (s.fitted ? "" : ", gains of " + fitted.values.state),
                  formatNumber(s.train_before.all.nrmse), formatNumber(s.train_after.all.nrmse),
                  formatNumber(s.heldout_before.all.nrmse), formatNumber(s.heldout_after.all.nrmse),
                  s.gain ? fmt::format("{:.3f}", s.gain->ratio) : "-",
                  s.gain ? fmt::format("{:.3f} .. {:.3f}", s.gain->low, s.gain->high) : "-"});
  return table.text();
}

}  // namespace probelab
