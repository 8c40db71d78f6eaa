// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab budget`: where a field's error comes from, one stage made finite at a time.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/build_info.h"
#include "base/error.h"
#include "base/progress.h"
#include "budget_rungs.h"
#include "budget_score.h"
#include "commands.h"
#include "common_options.h"
#include "device.h"
#include "evaluation.h"
#include "field_setup.h"
#include "layout_json.h"
#include "require.h"
#include "scored_receivers.h"
#include "table.h"

namespace probelab {
namespace {

constexpr double kWorkingBytes = 1 << 30;  // more than that is said

struct BudgetOptions {
  SceneOptions scene;
  FieldOptions field;
  ScoredReceiverOptions receivers;
  BudgetRays rays;
};

struct RungText {
  const char* name;
  const char* about;
};
constexpr RungText kExact = {
    "exact", "path-traced probes at the very normal, traced visibility: interpolation is left"};
constexpr RungText kMoments = {"moments",
                               "+ visibility from moments of distances, in the very direction"};
constexpr RungText kNoVisibility = {"moments", "+ no visibility, as the parameters say"};
constexpr RungText kTexels = {"texels", "+ octahedral maps of irradiance and moments"};
constexpr RungText kRays = {"rays", "+ as many rays as the field shoots, in its directions"};
constexpr RungText kFormats = {"formats", "+ the formats, encodings and rounding of the atlases"};
constexpr RungText kField = {
    "field", "+ light of the bounces from the probes themselves: what evaluate scores"};

Receivers scoredReceivers(const Receivers& receivers, ScoredSplit split) {
  Receivers scored = receivers;
  std::erase_if(scored.points, [&](const Receiver& r) { return !isScored(r, split); });
  if (scored.points.empty())
    throwInput(
        "no receiver is in the part of --split; take more of them with --count, or --split all");
  return scored;
}

void checkOptions(const BudgetOptions& options) {
  if (options.field.mode != "converged")
    throwInput("--mode {}: a budget is of the converged field; leave --mode out",
               options.field.mode);
  if (options.rays.exact < 2 || options.rays.exact % 2 != 0)
    throwInput("--exact-rays {}: they are shared among two estimates; give an even number",
               options.rays.exact);
}

Json describe(const BudgetOptions& options, FieldSetup& setup, const FieldRun& run,
              const Truth& truth, const BudgetEstimates& estimates) {
  const ProbeField& field = *setup.field;
  return {{"scene", setup.scene.name},
          {"state", setup.scene.state},
          {"strategy", field.layout().strategy},
          {"lattice", latticeJson(field.layout())},
          {"layout", layoutJson(field.layout())},
          {"probes",
           {{"stored", field.probeCount()},
            {"active", field.states().activeCount()},
            {"read", estimates.probes_read}}},
          {"params", toJson(setup.params)},
          {"mode", options.field.mode},
          {"error", nullptr},
          {"rungs", nullptr},
          {"noise_floor", nullptr},
          {"exact",
           {{"rays", options.rays.exact},
            {"lobe_rays", options.rays.lobe},
            {"closest_rays", estimates.work.closest},
            {"shadow_rays", estimates.work.shadow},
            {"bytes", estimates.bytes}}},
          {"layout_build_s", field.layout().build_s},
          {"memory_bytes", field.atlasBytes() + field.stateBytes()},
          {"updates", run.updates},
          {"converged", convergedJson(run.converged.value_or(ConvergeReport{}))},
          {"receivers", receiversJson(options.receivers, truth)},
          {"ray_proxy", proxyJson(setup.proxy.get())},
          {"device", setup.gpu.info().name},
          {"tracer", field.tracerName()},
          {"seed", field.options().seed},
          {"version", buildInfo().version},
          {"provenance", toJson(setup.provenance)}};
}

// The result's names before there is one.
Json outlineOf(const BudgetOptions& options, FieldSetup& setup) {
  Json outline = describe(options, setup, {}, {}, {});
  outline["error"] = outline["noise_floor"] = scoreOutline()["error"];
  outline["rungs"] = Json::array();
  return outline;
}

BudgetEstimates estimate(const BudgetOptions& options, FieldSetup& setup, const FieldRun& run,
                         const Receivers& scored, const Invocation& invocation) {
  std::vector<QueryPoint> points;
  for (const Receiver& r : scored.points) points.push_back({r.position, r.normal, r.view});
  const ProbeField& field = *setup.field;
  const BudgetField taken{setup.scene,
                          setup.embree,
                          field.layout(),
                          field.states(),
                          field.params(),
                          field.options().seed,
                          run.converged->mixing_updates,
                          run.converged->average_updates};
  Progress progress("budget", 1, invocation.common.quiet);
  BudgetEstimates estimates =
      estimateBudget(taken, options.rays, points, [&](double done) { progress.update(done); });
  progress.finish();
  return estimates;
}

std::vector<BudgetRung> scoreRungs(const BudgetEstimates& estimates, const RungEstimate& field,
                                   const Receivers& scored, bool visibility) {
  const auto rung = [&](const RungText& text, const RungEstimate& from) {
    return scoreRung(text.name, text.about, from, scored);
  };
  return {rung(kExact, estimates.exact),
          rung(visibility ? kMoments : kNoVisibility, estimates.moments),
          rung(kTexels, estimates.texels),
          rung(kRays, estimates.rays),
          rung(kFormats, estimates.formats),
          rung(kField, field)};
}

void printBudget(const Json& r) {
  const Json& exact = r["exact"];
  fmt::print(
      "{}",
      formatFields(
          {{"scene",
            fmt::format("{}, {}", r["scene"].get<std::string>(), r["state"].get<std::string>())},
           {"probes", fmt::format("{}; {} read", formatLayout(r), r["probes"]["read"].dump())},
           {"parameters", r["params"]["name"].get<std::string>()},
           {"run", fmt::format("converged, {} updates", r["updates"].dump())},
           {"device", fmt::format("{}, tracer {}", r["device"].get<std::string>(),
                                  r["tracer"].get<std::string>())},
           {"receivers", fmt::format("{}, scored: {}", r["receivers"]["count"].dump(),
                                     r["receivers"]["split"].get<std::string>())},
           {"exact", fmt::format("{} paths a probe, {} distances a lobe", exact["rays"].dump(),
                                 exact["lobe_rays"].dump())},
           {"noise floor", formatNumber(r["noise_floor"]["nrmse"].get<double>()) +
                               "  (nrmse of the truth's own noise; no part of the rungs)"}}));
  fmt::print("\n{}", formatRungs(r["rungs"]));
}

void runBudget(const BudgetOptions& options, const Invocation& invocation) {
  checkOptions(options);
  const ScoredSplit split = parseScoredSplit(options.receivers.split);
  FieldSetup setup(options.scene, options.field, invocation);
  checkRequirementNames(invocation.common.require, outlineOf(options, setup));
  const Truth truth = obtainTruth(options.receivers, setup, invocation);
  const Receivers scored = scoredReceivers(truth.receivers, split);
  if (!(meanReference(scored, ScoredSplit::all) > 0))
    throwInput("{}: no scored receiver gets light in state {}, so there is no error to part",
               setup.scene.name, setup.scene.state);
  const FieldRun run = runField(*setup.field, options.field, invocation);
  RungEstimate field;
  field.first = field.second = queryReceivers(*setup.field, scored);
  requireNoValidationMessages(setup.gpu);
  const BudgetEstimates estimates = estimate(options, setup, run, scored, invocation);
  if (static_cast<double>(estimates.bytes) > kWorkingBytes)
    note(invocation, "note: the maps of {} probes took {}", estimates.probes_read,
         formatBytes(static_cast<double>(estimates.bytes)));
  const std::vector<BudgetRung> rungs =
      scoreRungs(estimates, field, scored, setup.params.visibility != 0);
  Json result = describe(options, setup, run, truth, estimates);
  result["error"] = toJson(rungs.back().report);
  result["rungs"] = rungsJson(rungs);
  result["noise_floor"] = result["error"]["noise_floor"];
  reportResult(invocation, result, [&] { printBudget(result); });
}

}  // namespace

void addBudgetCommand(Program& program) {
  auto options = std::make_shared<BudgetOptions>();
  CLI::App& app = program.addCommand(
      "budget", "where a field's error comes from: its stages made exact, one at a time",
      "probelab budget scenes/two_rooms_door/scene.toml --probes 256 --params probelab",
      [options](const Invocation& invocation) { runBudget(*options, invocation); });
  addSceneOptions(app, options->scene, false);
  addFieldOptions(app, options->field);
  addScoredReceiverOptions(app, options->receivers);
  app.add_option("--exact-rays", options->rays.exact,
                 "paths a probe for the rungs without finite rays, half of them in either of two "
                 "estimates whose product has no noise")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str()
      ->group("Budget");
}

}  // namespace probelab
