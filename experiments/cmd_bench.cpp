// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab bench`: times of every stage of an update, next to baselines timed in the same run.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/progress.h"
#include "base/timer.h"
#include "commands.h"
#include "ddgi/directions.h"
#include "device.h"
#include "evaluation.h"
#include "field_setup.h"
#include "require.h"
#include "table.h"
#include "trace/bare_loop.h"
#include "trace/receivers.h"

namespace probelab {
namespace {

constexpr int kDefaultUpdates = 20;
constexpr int kDefaultProbes = 2048;  // 16 x 8 x 16
constexpr int kDefaultRays = 128;
constexpr uint32_t kPoints = 4096;  // receivers for the query and the reference
constexpr uint32_t kReferenceSamples = 64;

struct BenchOptions {
  SceneOptions scene{.scene = "scenes/pillar_hall/scene.toml", .state = "", .camera = ""};
  FieldOptions field;
};

// The rays of update number `update`, as the generate stage makes them.
std::vector<Ray> updateRays(const ProbeField& field, uint64_t update) {
  const std::vector<Vec3f> directions =
      updateDirections(field.params().rays, field.options().seed, update);
  std::vector<Ray> rays;
  rays.reserve(directions.size() * field.layout().positions.size());
  for (const Vec3f& position : field.layout().positions)
    for (const Vec3f& direction : directions)
      rays.push_back({position, 0, direction, kMissDistance});
  return rays;
}

// Times of the updates, and of the bare loop over each update's own rays right after it, so that
// whatever else the machine does meets both.
struct BenchRun {
  FieldRun field;
  std::vector<double> bare_ms;
};

BenchRun runUpdates(FieldSetup& setup, const FieldOptions& options, const Invocation& invocation) {
  const BareLoop bare(setup.scene);
  BenchRun run;
  run.field = runField(*setup.field, options, invocation, [&](int done, int) {
    run.bare_ms.push_back(
        bare.milliseconds(updateRays(*setup.field, static_cast<uint64_t>(done - 1))));
  });
  return run;
}

Json summaryJson(const std::vector<double>& times) {
  const TimeSummary summary = summarizeTimes(afterWarmUp(times));
  return {{"median_ms", summary.median}, {"p5_ms", summary.p5}, {"p95_ms", summary.p95}};
}

// The median over updates of baseline / ours: above 1 where ours is faster.
Json ratioJson(const std::vector<double>& ours, const std::vector<double>& baseline) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < std::min(ours.size(), baseline.size()); ++i)
    if (ours[i] > 0) ratios.push_back(baseline[i] / ours[i]);
  if (ratios.empty()) return nullptr;
  return percentile(afterWarmUp(ratios), 0.5);
}

double raysPerSecond(double rays, const std::vector<double>& ms) {
  const double median = summarizeTimes(afterWarmUp(ms)).median;
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

Json describe(FieldSetup& setup, const BenchRun& run, const Invocation& invocation) {
  const ProbeField& field = *setup.field;
  const Receivers receivers = generateReceivers(setup.scene, setup.embree, setup.reachability,
                                                kPoints, invocation.common.seed);
  const auto rays = static_cast<double>(field.workOfUpdate().rays);
  const auto trace = run.field.stage_ms.find("trace");
  const std::vector<double> trace_ms =
      trace == run.field.stage_ms.end() ? std::vector<double>{} : trace->second;
  Json stages = {{"update", summaryJson(run.field.update_ms)}};
  for (const char* name : {"generate", "trace", "shade", "occlude", "resolve", "blend"})
    if (run.field.stage_ms.contains(name)) stages[name] = summaryJson(run.field.stage_ms.at(name));
  const Json speed = measureSpeed(*setup.field, run.field, receivers);
  return {{"scene", setup.scene.name},
          {"probes", field.probeCount()},
          {"rays", field.params().rays},
          {"params", setup.params.name},
          {"updates", run.field.updates},
          {"stages", stages},
          {"baselines", {{"bare_trace", summaryJson(run.bare_ms)}}},
          {"ratios", {{"trace_vs_bare", ratioJson(trace_ms, run.bare_ms)}}},
          {"rays_per_s",
           {{"trace", raysPerSecond(rays, trace_ms)},
            {"bare", raysPerSecond(rays, run.bare_ms)},
            {"reference", measureReference(setup, receivers, invocation.common.seed)}}},
          {"query_ns_per_point", speed["query_ns_per_point"]},
          {"frame_ms", speed["frame_ms"]},
          {"threads", setup.provenance.threads},
          {"device", setup.gpu.info().name},
          {"tracer", field.tracerName()}};
}

void printResult(const Json& r) {
  fmt::print(
      "{}",
      formatFields(
          {{"scene", r["scene"].get<std::string>()},
           {"field", fmt::format("{} probes, {} rays, {}", r["probes"].get<int>(),
                                 r["rays"].get<int>(), r["params"].get<std::string>())},
           {"device", fmt::format("{}, tracer {}, {} threads", r["device"].get<std::string>(),
                                  r["tracer"].get<std::string>(), r["threads"].get<int>())}}));
  TextTable table({"stage", "median ms", "p5 ms", "p95 ms"});
  const auto add = [&](const std::string& name, const Json& t) {
    table.addRow({name, formatNumber(t["median_ms"].get<double>()),
                  formatNumber(t["p5_ms"].get<double>()), formatNumber(t["p95_ms"].get<double>())});
  };
  for (const auto& [name, times] : r["stages"].items()) add(name, times);
  add("bare trace", r["baselines"]["bare_trace"]);
  fmt::print("\n{}\n", table.text());
  const auto number = [](const Json& v) {
    return v.is_null() ? std::string("-") : formatNumber(v.get<double>());
  };
  const auto mega = [&](const char* name) {
    const Json& v = r["rays_per_s"][name];
    return v.is_null() ? std::string("-") : formatNumber(v.get<double>() * 1e-6) + " Mray/s";
  };
  fmt::print(
      "{}",
      formatFields({{"trace against bare", number(r["ratios"]["trace_vs_bare"])},
                    {"trace", mega("trace")},
                    {"bare loop", mega("bare")},
                    {"reference", mega("reference") + ", shading and light included"},
                    {"query", number(r["query_ns_per_point"]) + " ns a point"},
                    {"frame", number(r["frame_ms"]) + " ms (an update and 1920 x 1080 queries)"}}));
}

void runBench(const BenchOptions& options, const Invocation& invocation) {
  FieldSetup setup(options.scene, options.field, invocation);
  const BenchRun run = runUpdates(setup, options.field, invocation);
  Json result = describe(setup, run, invocation);
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
      "bench", "times of every stage of an update, next to a bare ray loop in the same run",
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
}

}  // namespace probelab
