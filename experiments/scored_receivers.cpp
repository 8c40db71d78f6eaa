// SPDX-License-Identifier: GPL-3.0-or-later
#include "scored_receivers.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

namespace probelab {

void addScoredReceiverOptions(CLI::App& app, ScoredReceiverOptions& options) {
  CLI::Option* receivers =
      app.add_option(
             "--receivers", options.file,
             "receivers with truth, as 'probelab receivers' writes (default: traced, or from "
             "the cache)")
          ->type_name("R.json")
          ->group("Receivers");
  app.add_option("--split", options.split,
                 "receivers that are scored: heldout, train (those for fitting) or all")
      ->type_name("PART")
      ->check(CLI::IsMember({"heldout", "train", "all"}).description(""))
      ->capture_default_str()
      ->group("Receivers");
  addTruthOptions(app, options.truth);
  for (const char* other : {"--count", "--points"}) receivers->excludes(app.get_option(other));
}

Truth obtainTruth(const ScoredReceiverOptions& options, const SceneSetup& setup,
                  const Invocation& invocation) {
  if (!options.file.empty()) return {readReceivers(options.file, setup.scene), false};
  return obtainTruth(options.truth, setup.scene, setup.embree, setup.reachability, invocation);
}

Json receiversJson(const ScoredReceiverOptions& options, const Truth& truth) {
  return {{"count", truth.receivers.points.size()},
          {"split", options.split},
          {"file", options.file.empty() ? Json(nullptr) : Json(options.file)},
          {"samples", truth.receivers.samples},
          {"rel_error", truth.receivers.rel_error},
          {"seconds", truth.receivers.seconds},
          {"from_cache", truth.from_cache}};
}

Json convergedJson(const std::optional<ConvergeReport>& report) {
  if (!report) return nullptr;
  return {{"burn_in_updates", report->burn_in_updates}, {"mixing_updates", report->mixing_updates},
          {"average_updates", report->average_updates}, {"settled", report->settled},
          {"contraction", report->contraction},         {"remaining", report->remaining}};
}

}  // namespace probelab
