// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab evaluate`: errors, leaks, speed, work and memory of a probe field against path tracing.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "ablation_run.h"
#include "base/build_info.h"
#include "base/files.h"
#include "commands.h"
#include "common_options.h"
#include "device.h"
#include "evaluation.h"
#include "field_dump.h"
#include "field_setup.h"
#include "layout_json.h"
#include "require.h"
#include "scored_receivers.h"
#include "table.h"

namespace probelab {
namespace {

struct EvaluateOptions {
  SceneOptions scene;
  FieldOptions field;
  ScoredReceiverOptions receivers;
  std::string dump, dump_field, ablation;
};

Json describe(const EvaluateOptions& options, FieldSetup& setup, const FieldRun& run) {
  const ProbeField& field = *setup.field;
  return {{"scene", setup.scene.name},
          {"state", setup.scene.state},
          {"strategy", field.layout().strategy},
          {"lattice", latticeJson(field.layout())},
          {"layout", layoutJson(field.layout())},
          {"probes", {{"stored", field.probeCount()}, {"active", field.states().activeCount()}}},
          {"params", toJson(setup.params)},
          {"mode", options.field.mode},
          {"error", nullptr},
          {"speed", nullptr},
          {"work", workJson(field.workOfUpdate())},
          {"layout_build_s", field.layout().build_s},
          {"memory_bytes", field.atlasBytes() + field.stateBytes()},
          {"memory", memoryJson(field)},
          {"updates", run.updates},
          {"stopped_early", run.stopped_early},
          {"converged", convergedJson(run.converged)},
          {"temporal", nullptr},
          {"stability", nullptr},
          {"ray_proxy", proxyJson(setup.proxy.get())},
          {"values", toJson(run.values)},
          {"device", setup.gpu.info().name},
          {"tracer", field.tracerName()},
          {"seed", field.options().seed},
          {"version", buildInfo().version}};
}

void printErrors(const Json& error) {
  TextTable table({"error", "all", "noise floor", "surface", "volume"});
  const auto cell = [](const Json& from, const std::string& name) {
    if (from.is_null() || from[name].is_null()) return std::string("-");
    return formatNumber(from[name].get<double>());
  };
  for (const auto& [name, floor] : error["noise_floor"].items())
    if (!floor.is_array())
      table.addRow({name, cell(error, name), cell(error["noise_floor"], name),
                    cell(error["surface"], name), cell(error["volume"], name)});
  fmt::print("\n{}", table.text());
}

void printSpeed(const Json& speed) {
  TextTable table({"time", "median", "p5", "p95"});
  for (const auto& [name, range] : speed["spread"].items())
    table.addRow({name, formatNumber(speed[name].get<double>()),
                  formatNumber(range[0].get<double>()), formatNumber(range[1].get<double>())});
  fmt::print("\n{}", table.text());
  fmt::print("{}", formatFields({{"frame_ms", formatNumber(speed["frame_ms"].get<double>()) +
                                                  "  (an update and 1920 x 1080 queries)"}}));
  for (const auto& [name, ms] : speed["state_ms"].items())
    fmt::print("{}", formatFields({{name + "_ms", formatNumber(ms.get<double>()) +
                                                      "  (once, before the first update)"}}));
}

// The result's names before there is one.
Json outlineOf(const EvaluateOptions& options, FieldSetup& setup) {
  FieldRun run;
  const bool temporal = options.field.mode == "temporal";
  if (!temporal) run.converged = ConvergeReport{};
  Json outline = describe(options, setup, run);
  outline.update(scoreOutline());
  outline["receivers"] = receiversJson(options.receivers, {});
  if (temporal) outline["temporal"] = Json::object();
  outline["provenance"] = toJson(setup.provenance);
  return outline;
}

std::string formatRun(const Json& r) {
  const std::string text =
      fmt::format("{}, {} updates", r["mode"].get<std::string>(), r["updates"].get<int>());
  return r["stopped_early"].get<bool>()
             ? fmt::format("{}, stopped early at {}", text, r["updates"].get<int>())
             : text;
}

std::string formatMemory(const Json& memory) {
  return fmt::format("{} of atlases, {} bytes a probe; {} of state and index",
                     formatBytes(memory["atlas"].get<double>()), memory["atlas_per_probe"].dump(),
                     formatBytes(memory["state_and_index"].get<double>()));
}

void printResult(const Json& r) {
  fmt::print(
      "{}",
      formatFields({{"scene", fmt::format("{}, {}", r["scene"].get<std::string>(),
                                          r["state"].get<std::string>())},
                    {"probes", formatLayout(r)},
                    {"parameters", r["params"]["name"].get<std::string>()},
                    {"run", formatRun(r)},
                    {"device", fmt::format("{}, tracer {}", r["device"].get<std::string>(),
                                           r["tracer"].get<std::string>())},
                    {"receivers", fmt::format("{}, scored: {}", r["receivers"]["count"].get<int>(),
                                              r["receivers"]["split"].get<std::string>())},
                    {"memory", formatMemory(r["memory"])}}));
  if (!r["ray_proxy"].is_null())
    fmt::print("{}", formatFields({{"ray proxy", formatProxy(r["ray_proxy"])}}));
  if (!r["values"].is_null())
    fmt::print("{}", formatFields({{"values", formatValues(r["values"])}}));
  printErrors(r["error"]);
  printSpeed(r["speed"]);
  const Json& s = r["stability"];
  fmt::print("\nstability  {} non-finite, {} clamped, {} tiny weight sums\n",
             s["non_finite"].dump(), s["clamped"].dump(), s["tiny_weight_sum"].dump());
  fmt::print(
      "fallback   {} queries at receivers ({} answered without visibility, {} by the nearest "
      "probe, {} by 0), {} bounce queries\n",
      s["fallback_queries"].dump(), s["unoccluded_answers"].dump(), s["nearest_answers"].dump(),
      s["empty_answers"].dump(), s["bounce_fallback_queries"].dump());
}

// What a number alone would not tell.
void warnOf(const Json& result, const Invocation& invocation) {
  if (result["error"]["nrmse"].is_null())
    note(invocation,
         "warning: no scored receiver gets light, so ratios are undefined; see max_abs, "
         "the largest estimate");
  if (result["stability"]["clamped"].get<uint64_t>() > 0)
    note(invocation,
         "warning: {} texels were beyond the largest number of their format; use "
         "--set irradiance_format=rgba32f",
         result["stability"]["clamped"].get<uint64_t>());
}

void printAblation(const Json& r) {
  fmt::print(
      "{}",
      formatFields({{"scene", fmt::format("{}, {}", r["scene"].get<std::string>(),
                                          r["state"].get<std::string>())},
                    {"ablation", r["about"].get<std::string>()},
                    {"run", r["mode"].get<std::string>()},
                    {"device", fmt::format("{}, tracer {}", r["device"].get<std::string>(),
                                           r["tracer"].get<std::string>())},
                    {"receivers", fmt::format("{}, scored: {}", r["receivers"]["count"].get<int>(),
                                              r["receivers"]["split"].get<std::string>())}}));
  fmt::print("\n{}", formatAblation(r));
}

void runAblationCommand(const EvaluateOptions& options, const Invocation& invocation) {
  const ScoredSplit split = parseScoredSplit(options.receivers.split);
  const Ablation ablation = loadAblation(options.ablation);
  const std::vector<AblationCase> cases = resolveAblation(ablation, options.field);
  SceneSetup setup(options.scene, invocation);
  const Truth truth = obtainTruth(options.receivers, setup, invocation);
  const Json rows = runAblation(setup, cases, truth.receivers, split, invocation);
  requireNoValidationMessages(setup.gpu);
  Json result = {
      {"scene", setup.scene.name},
      {"state", setup.scene.state},
      {"strategy", options.field.strategy},
      {"layout", options.field.layout.empty() ? Json(nullptr) : Json(options.field.layout)},
      {"params", toJson(cases.front().params)},
      {"mode", options.field.mode},
      {"receivers", receiversJson(options.receivers, truth)},
      {"error", rows["ablation"][0]["error"]},
      {"speed", rows["ablation"][0]["speed"]},
      {"name", ablation.name},
      {"about", ablation.about}};
  result.update(rows);
  result["device"] = setup.gpu.info().name;
  result["tracer"] = setup.provenance.tracer;
  result["seed"] = invocation.common.seed;
  result["version"] = buildInfo().version;
  result["provenance"] = toJson(setup.provenance);
  reportResult(invocation, result, [&] { printAblation(result); });
}

void runEvaluate(const EvaluateOptions& options, const Invocation& invocation) {
  if (!options.ablation.empty()) return runAblationCommand(options, invocation);
  const ScoredSplit split = parseScoredSplit(options.receivers.split);
  if (!options.dump.empty()) checkOutput(options.dump, ".csv");
  if (!options.dump_field.empty()) checkDumpFolder(options.dump_field);
  FieldSetup setup(options.scene, options.field, invocation);
  checkRequirementNames(invocation.common.require, outlineOf(options, setup));
  const Truth truth = obtainTruth(options.receivers, setup, invocation);
  ProbeField& field = *setup.field;
  const bool temporal = options.field.mode == "temporal";
  TemporalRecord record(field, truth.receivers, split);
  const FieldRun run = runField(field, options.field, invocation, [&](int done, int) {
    if (temporal) record.add(done);
  });
  const Counters before = field.counters();
  const std::vector<Vec3f> estimates = queryReceivers(field, truth.receivers);
  Json result = describe(options, setup, run);
  result["receivers"] = receiversJson(options.receivers, truth);
  result["error"] = toJson(scoreEstimates(estimates, truth.receivers, split));
  result["stability"] = stabilityJson(before, field.counters());
  result["speed"] = measureSpeed(field, run, truth.receivers);
  if (temporal) result["temporal"] = record.toJson();
  result["provenance"] = toJson(setup.provenance);
  requireNoValidationMessages(setup.gpu);
  warnOf(result, invocation);

  if (!options.dump.empty())
    writeTextFile(options.dump, formatEstimates(estimates, truth.receivers, setup.scene));
  if (!options.dump_field.empty())
    dumpField(options.dump_field, setup.scene, field, setup.provenance);
  reportResult(invocation, result, [&] { printResult(result); });
}

}  // namespace

void addEvaluateCommand(Program& program) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App& app = program.addCommand(
      "evaluate", "errors, leaks and speed of a probe field against path tracing",
      "probelab evaluate scenes/cornell/scene.toml --params rtxgi --require 'nrmse<=0.1'",
      [options](const Invocation& invocation) { runEvaluate(*options, invocation); });
  addSceneOptions(app, options->scene, false);
  addFieldOptions(app, options->field);
  addValuesOption(app, options->field);
  addScoredReceiverOptions(app, options->receivers);
  app.add_option("--dump", options->dump,
                 "every receiver with estimate and truth (irradiance; metres)")
      ->type_name("EST.csv")
      ->group("Output");
  app.add_option("--dump-field", options->dump_field,
                 "an existing folder for the field: atlases (EXR), probe positions, parameters")
      ->type_name("DIR")
      ->group("Output");
  CLI::Option* ablation =
      app.add_option("--ablation", options->ablation,
                     fmt::format("one table of rows, each a change to the parameters, with errors, "
                                 "leaks and times beside the base's: {} or a TOML file",
                                 fmt::join(ablationNames(), ", ")))
          ->type_name("NAME|FILE")
          ->check(checkNamed)
          ->group("Output");
  for (const char* other : {"--dump", "--dump-field", "--values"})
    ablation->excludes(app.get_option(other));
}

}  // namespace probelab
