// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab receivers`: points with path-traced field irradiance, the truth of `evaluate`.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/progress.h"
#include "commands.h"
#include "json.h"
#include "program.h"
#include "provenance.h"
#include "require.h"
#include "table.h"
#include "truth.h"

namespace probelab {
namespace {

struct ReceiversOptions {
  SceneOptions scene;
  std::string output;
  TruthOptions truth;
};

Json summarize(const Truth& truth) {
  const Receivers& receivers = truth.receivers;
  int counts[3] = {0, 0, 0}, heldout = 0;
  Vec3d mean;
  double weight = 0;
  for (const Receiver& point : receivers.points) {
    ++counts[static_cast<std::size_t>(point.kind)];
    heldout += point.split == Split::heldout;
    mean = mean + (Vec3d(point.a) + Vec3d(point.b)) * (0.5 * point.area);
    weight += point.area;
  }
  if (weight > 0) mean = mean / weight;
  const auto total = static_cast<int>(receivers.points.size());
  return {{"receivers", total},
          {"surface", counts[0]},
          {"volume", counts[1]},
          {"points", counts[2]},
          {"train", total - heldout},
          {"heldout", heldout},
          {"mean_irradiance", {mean.x, mean.y, mean.z}},
          {"samples", receivers.samples},
          {"rel_error", receivers.rel_error},
          {"seconds", receivers.seconds},
          {"rays", receivers.rays},
          {"rays_per_s", receivers.seconds > 0
                             ? Json(static_cast<double>(receivers.rays) / receivers.seconds)
                             : Json(nullptr)},
          {"from_cache", truth.from_cache}};
}

void printReceivers(const Json& r) {
  const auto& mean = r["mean_irradiance"];
  fmt::print(
      "{}",
      formatFields(
          {{"receivers",
            fmt::format("{} ({} surface, {} volume, {} given)", r["receivers"].get<int>(),
                        r["surface"].get<int>(), r["volume"].get<int>(), r["points"].get<int>())},
           {"split",
            fmt::format("{} train, {} held-out", r["train"].get<int>(), r["heldout"].get<int>())},
           {"mean irradiance", fmt::format("{:.4g} {:.4g} {:.4g}", mean[0].get<double>(),
                                           mean[1].get<double>(), mean[2].get<double>())},
           {"samples", fmt::format("{} a receiver", r["samples"].get<int>())},
           {"relative error", formatNumber(r["rel_error"].get<double>())},
           {"time", formatDuration(r["seconds"].get<double>()) +
                        (r["from_cache"].get<bool>() ? " (then; now from the cache)" : "")}}));
}

void runReceivers(const ReceiversOptions& options, const Invocation& invocation) {
  checkOutput(options.output, ".json");
  const Scene scene = loadScene(options.scene, invocation);
  const EmbreeScene embree(scene);
  const Reachability reachability = findReachable(scene, embree);
  const Truth truth = obtainTruth(options.truth, scene, embree, reachability, invocation);
  writeReceivers(options.output, truth.receivers, scene);
  note(invocation, "wrote {}", options.output);
  Json result = summarize(truth);
  result["output"] = options.output;
  result["scene"] = scene.name;
  result["state"] = scene.state;
  result["provenance"] = toJson(makeProvenance(invocation, scene));
  reportResult(invocation, result, [&] { printReceivers(result); });
}

}  // namespace

void addReceiversCommand(Program& program) {
  auto options = std::make_shared<ReceiversOptions>();
  CLI::App& app = program.addCommand(
      "receivers", "receivers with path-traced irradiance, the truth of 'evaluate'",
      "probelab receivers scenes/cornell/scene.toml -o receivers.json --rel-error 0.01",
      [options](const Invocation& invocation) { runReceivers(*options, invocation); });
  addSceneOptions(app, options->scene, false);
  addOutputOption(app, options->output, "R.json", "the receivers", true);
  addTruthOptions(app, options->truth);
}

}  // namespace probelab
