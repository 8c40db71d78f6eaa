// SPDX-License-Identifier: GPL-3.0-or-later
#include "drawn_lights.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <span>

#include "base/error.h"
#include "evaluation.h"
#include "placement/training_data.h"

namespace probelab {
namespace {

constexpr int kReceivers = 2048;
constexpr int kRays = 1024;  // a receiver: the truth's noise must not hide what layouts differ by
constexpr uint64_t kSeedOffset = 0x64726177;  // no seed of a training

// Errors under one state, of irradiance / pi in luminance; `receivers` take the state's truth.
ErrorMetrics errorUnder(const Training::Data& data, std::span<const float> estimates,
                        std::size_t state, Receivers& receivers) {
  std::vector<Vec3f> estimate;
  for (std::size_t r = 0; r < receivers.points.size(); ++r) {
    const std::size_t at = r * data.stateCount() + state;
    estimate.emplace_back(estimates[at]);
    receivers.points[r].a = receivers.points[r].b = Vec3f(data.truth[at]);
  }
  return scoreEstimates(estimate, receivers, ScoredSplit::heldout).all;
}

Json readingJson(const std::optional<ReadingBound>& bound) {
  if (!bound) return nullptr;
  return {{"nrmse", bound->nrmse}, {"unseen", bound->unseen}, {"seen", bound->seen}};
}

}  // namespace

DrawnLightsScore scoreDrawnLights(const PlacementScene& of, const ProbeLayout& layout,
                                  const Params& params, int lights, uint64_t seed) {
  const Scene scene = trainScene(of.scene);
  Training training(scene, of.embree, of.reachability,
                    {.receivers = kReceivers,
                     .lights = lights,
                     .split = Split::heldout,
                     .seed = seed + kSeedOffset,
                     .receiver_rays = kRays,
                     .lamps_each = 1,
                     .own_lights = false});
  const Training::Data& data = training.data();
  const LayoutBake bake = bakeLayout(*data.patches, layout, params, data.settings.seed);
  const std::vector<float> estimates = estimateLayout(data, layout, params, bake);
  Receivers receivers;
  receivers.points = data.receivers;
  DrawnLightsScore score{static_cast<int>(data.receivers.size()), {}, {}};
  for (std::size_t l = 0; l < data.stateCount(); ++l)
    if (data.power[l] > 0)
      score.lights.push_back(
          {data.patches->lighting()[l].name, errorUnder(data, estimates, l, receivers)});
  if (score.lights.empty())
    throwInput("--drawn-lights: no indirect light of those that were drawn reaches a receiver of {}",
               of.scene.path);
  score.reading = boundReading(data, layout, params, bake, estimates);
  return score;
}

Json toJson(const DrawnLightsScore& score) {
  Json each = Json::array();
  double squares = 0, smape = 0, light_leak = 0, shadow_leak = 0;
  for (const DrawnLight& light : score.lights) {
    const ErrorMetrics& e = light.error;
    squares += e.nrmse.value_or(0) * e.nrmse.value_or(0);
    smape += e.smape.value_or(0);
    light_leak += e.light_leak.value_or(0);
    shadow_leak += e.shadow_leak.value_or(0);
    each.push_back({{"kind", light.kind},
                    {"nrmse", optionalNumber(e.nrmse)},
                    {"smape", optionalNumber(e.smape)},
                    {"light_leak", optionalNumber(e.light_leak)},
                    {"shadow_leak", optionalNumber(e.shadow_leak)}});
  }
  const auto n = static_cast<double>(score.lights.size());
  return {{"lights", score.lights.size()},
          {"receivers", score.receivers},
          {"nrmse", std::sqrt(squares / n)},
          {"smape", smape / n},
          {"light_leak", light_leak / n},
          {"shadow_leak", shadow_leak / n},
          {"each", each},
          {"reading", readingJson(score.reading)}};
}

}  // namespace probelab
