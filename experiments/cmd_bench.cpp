// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab bench`: times of every stage of an update, next to baselines timed in the same run: a
// bare ray loop, and blending and query as the textbook has them.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/timer.h"
#include "bench_baselines.h"
#include "bench_sweep.h"
#include "commands.h"
#include "device.h"
#include "evaluation.h"
#include "field_setup.h"
#include "layout_json.h"
#include "require.h"
#include "table.h"
#include "trace/receivers.h"

namespace probelab {
namespace {

constexpr int kDefaultUpdates = 20;
constexpr int kDefaultProbes = 2048;  // 16 x 8 x 16
constexpr int kDefaultRays = 128;
constexpr int kSweepProbes = 32768, kFewestSweepProbes = 2048;
constexpr uint32_t kPoints = 4096;  // receivers for the query and the reference
constexpr uint32_t kReferenceSamples = 64;
constexpr double kFramePoints = 1920 * 1080;
constexpr const char* kStages[] = {"generate", "trace", "shade",      "occlude",
                                   "resolve",  "blend", "variability"};

struct BenchOptions {
  SceneOptions scene{.scene = "scenes/pillar_hall/scene.toml", .state = "", .camera = ""};
  FieldOptions field;
  bool sweep = false;
  int sweep_probes = kSweepProbes;
};

// The updates, each followed by all baselines, so that whatever else the machine does meets all.
FieldRun runUpdates(FieldSetup& setup, Baselines& baselines, const FieldOptions& options,
                    const Invocation& invocation) {
  return runField(*setup.field, options, invocation,
                  [&](int done, int) { baselines.measure(static_cast<uint64_t>(done - 1)); });
}

Json summaryJson(const std::vector<double>& times, const std::string& unit = "ms") {
  if (times.empty()) return nullptr;
  const TimeSummary summary = summarizeTimes(afterWarmUp(times));
  return {
      {"median_" + unit, summary.median}, {"p5_" + unit, summary.p5}, {"p95_" + unit, summary.p95}};
}

// The median over updates of baseline / ours / `scale`: above 1 where ours is faster.
Json ratioJson(const std::vector<double>& ours, const std::vector<double>& baseline,
               double scale = 1) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < std::min(ours.size(), baseline.size()); ++i)
    if (ours[i] > 0) ratios.push_back(baseline[i] / ours[i] / scale);
  if (ratios.empty()) return nullptr;
  return percentile(afterWarmUp(ratios), 0.5);
}

double medianOf(const std::vector<double>& times) {
  return summarizeTimes(afterWarmUp(times)).median;
}

double raysPerSecond(double rays, const std::vector<double>& ms) {
  const double median = medianOf(ms);
  return median > 0 ? rays / median * 1e3 : 0;
}

Json measureReference(const FieldSetup& setup, const Receivers& receivers, uint64_t seed) {
  std::vector<IrradiancePoint> points;
  for (const Receiver& r : receivers.points) points.push_back({r.position, r.normal});
  const IrradianceEstimate estimate =
      estimateIrradiance(setup.scene, setup.embree, points, {.spp = kReferenceSamples}, seed);
  return estimate.seconds > 0 ? Json(static_cast<double>(estimate.rays.total()) / estimate.seconds)
                              : Json(nullptr);
}

std::vector<double> timesOf(const FieldRun& run, const std::string& stage) {
  const auto found = run.stage_ms.find(stage);
  return found == run.stage_ms.end() ? std::vector<double>{} : found->second;
}

Json stagesJson(const FieldRun& run) {
  Json stages = {{"update", summaryJson(run.update_ms)}};
  for (const char* name : kStages)
    if (run.stage_ms.contains(name)) stages[name] = summaryJson(run.stage_ms.at(name));
  return stages;
}

// The median over updates of the stages' sum over the wall time.
Json stageSumShare(const FieldRun& run) {
  std::vector<double> shares;
  for (std::size_t i = 0; i < run.update_ms.size(); ++i) {
    double sum = 0;
    for (const auto& [name, times] : run.stage_ms) sum += i < times.size() ? times[i] : 0;
    if (run.update_ms[i] > 0) shares.push_back(sum / run.update_ms[i]);
  }
  return shares.empty() ? Json(nullptr) : Json(medianOf(shares));
}

Json ratiosJson(const FieldRun& run, const Baselines& baselines, double rays) {
  const BaselineTimes& times = baselines.times();
  std::vector<double> resolve_ns = timesOf(run, "resolve");
  for (double& ns : resolve_ns) ns *= 1e6 / rays;
  return {{"trace_vs_bare", ratioJson(timesOf(run, "trace"), times.bare_ms)},
          {"blend_vs_textbook",
           ratioJson(timesOf(run, "blend"), times.textbook_blend_ms(), baselines.probeRatio())},
          {"query_vs_textbook", ratioJson(times.query_ns, times.textbook_query_ns)},
          {"resolve_vs_textbook_query", ratioJson(resolve_ns, times.textbook_query_ns)}};
}

Json baselinesJson(const Baselines& baselines) {
  const BaselineTimes& times = baselines.times();
  return {{"bare_trace", summaryJson(times.bare_ms)},
          {"textbook_blend", summaryJson(times.textbook_blend_ms())},
          {"textbook_blend_irradiance", summaryJson(times.textbook_irradiance_ms)},
          {"textbook_blend_moments", summaryJson(times.textbook_moments_ms)},
          {"textbook_query", summaryJson(times.textbook_query_ns, "ns")},
          {"textbook", baselines.textbookJson()}};
}

Json describe(FieldSetup& setup, const FieldRun& run, const Baselines& baselines,
              const Receivers& receivers, uint64_t seed) {
  const ProbeField& field = *setup.field;
  const auto rays = static_cast<double>(field.workOfUpdate().rays);
  const double query_ns = medianOf(baselines.times().query_ns);
  return {{"scene", setup.scene.name},
          {"probes", field.probeCount()},
          {"active_probes", field.states().activeCount()},
          {"rays", field.params().rays},
          {"params", setup.params.name},
          {"strategy", field.layout().strategy},
          {"layout", layoutJson(field.layout())},
          {"texels", {setup.params.irradiance_texels, setup.params.moment_texels}},
          {"updates", run.updates},
          {"stages", stagesJson(run)},
          {"stage_sum_share", stageSumShare(run)},
          {"baselines", baselinesJson(baselines)},
          {"ratios", ratiosJson(run, baselines, rays)},
          {"rays_per_s",
           {{"trace", raysPerSecond(rays, timesOf(run, "trace"))},
            {"bare", raysPerSecond(rays, baselines.times().bare_ms)},
            {"reference", measureReference(setup, receivers, seed)}}},
          {"query_ns_per_point", query_ns},
          {"frame_ms", medianOf(run.update_ms) + query_ns * kFramePoints * 1e-6},
          {"work", workJson(field.workOfUpdate())},
          {"memory", memoryJson(field)},
          {"ray_proxy", proxyJson(setup.proxy.get())},
          {"sweep", nullptr},
          {"threads", setup.provenance.threads},
          {"device", setup.gpu.info().name},
          {"tracer", field.tracerName()}};
}

std::string formatOptional(const Json& v) {
  return v.is_null() ? std::string("-") : formatNumber(v.get<double>());
}

void printTimes(const Json& r) {
  TextTable table({"stage", "median ms", "p5 ms", "p95 ms"});
  const auto add = [&](const std::string& name, const Json& t) {
    if (t.is_null()) return;
    table.addRow({name, formatNumber(t["median_ms"].get<double>()),
                  formatNumber(t["p5_ms"].get<double>()), formatNumber(t["p95_ms"].get<double>())});
  };
  for (const auto& [name, times] : r["stages"].items()) add(name, times);
  for (const char* name :
       {"bare_trace", "textbook_blend", "textbook_blend_irradiance", "textbook_blend_moments"})
    add(name, r["baselines"][name]);
  fmt::print("\n{}\n", table.text());
}

void printHead(const Json& r) {
  std::vector<std::pair<std::string, std::string>> fields = {
      {"scene", r["scene"].get<std::string>()},
      {"field", fmt::format("{} probes, {} active, {} rays, {}; texels {} and {} a side",
                            r["probes"].get<int>(), r["active_probes"].get<int>(),
                            r["rays"].get<int>(), r["params"].get<std::string>(),
                            r["texels"][0].get<int>(), r["texels"][1].get<int>())},
      {"device", fmt::format("{}, tracer {}, {} threads", r["device"].get<std::string>(),
                             r["tracer"].get<std::string>(), r["threads"].get<int>())}};
  const Json& textbook = r["baselines"]["textbook"];
  if (!textbook.is_null())
    fields.insert(fields.begin() + 2,
                  {"textbook", fmt::format("{} probes, {} rays, texels {} and {} a side, whatever "
                                           "the parameters; blending is compared a probe",
                                           textbook["probes"].dump(), textbook["rays"].dump(),
                                           textbook["irradiance_texels"].dump(),
                                           textbook["moment_texels"].dump())});
  if (!r["ray_proxy"].is_null()) fields.emplace_back("ray proxy", formatProxy(r["ray_proxy"]));
  fmt::print("{}", formatFields(fields));
}

void printResult(const Json& r) {
  printHead(r);
  printTimes(r);
  const auto mega = [&](const char* name) {
    const Json& v = r["rays_per_s"][name];
    return v.is_null() ? std::string("-") : formatNumber(v.get<double>() * 1e-6) + " Mray/s";
  };
  const Json& ratios = r["ratios"];
  const Json& query = r["baselines"]["textbook_query"];
  fmt::print(
      "{}",
      formatFields(
          {{"trace against bare", formatOptional(ratios["trace_vs_bare"])},
           {"blend against textbook", formatOptional(ratios["blend_vs_textbook"])},
           {"query against textbook", formatOptional(ratios["query_vs_textbook"])},
           {"resolve against it",
            formatOptional(ratios["resolve_vs_textbook_query"]) + ", a ray against a query"},
           {"stages over wall time", formatOptional(r["stage_sum_share"])},
           {"trace", mega("trace")},
           {"bare loop", mega("bare")},
           {"reference", mega("reference") + ", shading and light included"},
           {"query", formatOptional(r["query_ns_per_point"]) + " ns a point, the textbook's " +
                         (query.is_null() ? "-" : formatOptional(query["median_ns"]))},
           {"frame", formatOptional(r["frame_ms"]) + " ms (an update and 1920 x 1080 queries)"},
           {"work",
            fmt::format("{} rays, {} shadow rays, {} products of texel and ray, {} taps",
                        r["work"]["rays"].dump(), r["work"]["shadow_rays"].dump(),
                        r["work"]["texel_ray_products"].dump(), r["work"]["resolve_taps"].dump())},
           {"memory", fmt::format("{} bytes of texels a probe, {} in all",
                                  r["memory"]["atlas_per_probe"].dump(),
                                  formatBytes(r["memory"]["atlas"].get<double>()))}}));
  if (!r["sweep"].is_null()) fmt::print("{}", formatSweep(r["sweep"]));
}

void runBench(const BenchOptions& options, const Invocation& invocation) {
  FieldSetup setup(options.scene, options.field, invocation);
  const uint64_t seed = invocation.common.seed;
  const Receivers receivers =
      generateReceivers(setup.scene, setup.embree, setup.reachability, kPoints, seed);
  Baselines baselines(setup, timedPoints(receivers));
  if (!baselines.whyNoTextbook().empty())
    note(invocation, "warning: no textbook baseline: {}", baselines.whyNoTextbook());
  const FieldRun run = runUpdates(setup, baselines, options.field, invocation);
  Json result = describe(setup, run, baselines, receivers, seed);
  if (options.sweep)
    result["sweep"] =
        runSweep(setup, setup.params, options.field, options.sweep_probes, invocation);
  result["provenance"] = toJson(setup.provenance);
  requireNoValidationMessages(setup.gpu);
  reportResult(invocation, result, [&] { printResult(result); });
}

}  // namespace

void addBenchCommand(Program& program) {
  auto options = std::make_shared<BenchOptions>();
  options->field.probes = kDefaultProbes;
  options->field.rays = kDefaultRays;
  options->field.mode = "temporal";
  options->field.updates = kDefaultUpdates;
  CLI::App& app = program.addCommand(
      "bench",
      "times of every stage of an update, next to baselines in the same run: a bare ray loop, the "
      "textbook's blending and query",
      "probelab bench scenes/pillar_hall/scene.toml --require 'ratios.trace_vs_bare>=0.8'",
      [options](const Invocation& invocation) { runBench(*options, invocation); });
  addSceneOptions(app, options->scene, false);
  app.get_option("SCENE")->required(false)->capture_default_str();
  addPlacementOptions(app, options->field);
  addParamsOptions(app, options->field);
  addTracingOptions(app, options->field);
  app.add_option("--updates", options->field.updates, "updates that are timed")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->default_str(std::to_string(kDefaultUpdates))
      ->group("Field");
  app.add_flag("--sweep", options->sweep,
               "also time updates of 256 probes and more and of 16 to 1,024 rays, and fit lines "
               "(a minute or two)")
      ->group("Field")
      ->excludes(app.get_option("--layout"));
  app.add_option("--sweep-probes", options->sweep_probes,
                 "where --sweep ends; its rays end at a 32nd of it")
      ->type_name("N")
      ->check(CLI::Range(kFewestSweepProbes, 1 << 20).description(""))
      ->capture_default_str()
      ->group("Field");
}

}  // namespace probelab
