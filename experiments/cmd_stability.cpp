// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab stability`: the hard-case table, or the cases that need no special scene on a user's.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ctime>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "base/build_info.h"
#include "base/error.h"
#include "base/interrupt.h"
#include "base/progress.h"
#include "base/timer.h"
#include "commands.h"
#include "common_options.h"
#include "device.h"
#include "provenance.h"
#include "require.h"
#include "stability/suite.h"
#include "stability_curves.h"
#include "stability_long.h"
#include "stability_scene.h"
#include "table.h"

namespace probelab {
namespace {

constexpr int kSceneProbes = 64, kSceneReceivers = 256, kSceneUpdates = 16;
constexpr std::size_t kTableWidth = 100, kVerdictWidth = 7, kTitleWidth = 26, kGap = 2;

struct StabilityOptions {
  SceneStabilityOptions scene;
  std::string name;  // --case
  bool curves = false;
  std::optional<int> long_run;  // updates
  CLI::Option* scene_option = nullptr;
  std::vector<const CLI::Option*> of_scene;  // those that mean nothing without a SCENE
};

// Exit code 3.
class CaseFails : public Error {
 public:
  explicit CaseFails(const std::string& message) : Error(message, 3) {}
};

Json rowJson(const StabilityRow& row) {
  return {{"id", row.id},
          {"group", row.group},
          {"case", row.title},
          {"tracer", row.tracer},
          {"format", row.format},
          {"expectation", row.expectation},
          {"measured", row.measured.text},
          {"verdict", verdictName(row.measured.verdict)},
          {"breaking_point", optionalNumber(row.measured.breaking_point)},
          {"list", row.list},
          {"seconds", row.seconds}};
}

// Broken at spaces, or within a longer word, at most `width` columns wide.
std::vector<std::string> wrapped(const std::string& text, std::size_t width) {
  std::vector<std::string> lines{""};
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, end - at);
    if (!lines.back().empty() && lines.back().size() + 1 + word.size() > width)
      lines.emplace_back();
    lines.back() += (lines.back().empty() ? "" : " ") + word;
    while (lines.back().size() > width) {
      const std::string rest = lines.back().substr(width);
      lines.back().resize(width);
      lines.push_back(rest);
    }
    at = end + 1;
  }
  return lines;
}

std::string summary(const Json& cases) {
  std::map<std::string, int> counts;
  for (const Json& row : cases) ++counts[row["verdict"].get<std::string>()];
  return fmt::format("{} hold, {} limit{}, {} fail{}", counts["holds"], counts["limit"],
                     counts["limit"] == 1 ? "" : "s", counts["fails"],
                     counts["fails"] == 1 ? "s" : "");
}

std::size_t idWidth(const Json& cases) {
  std::size_t width = 0;
  for (const Json& row : cases) width = std::max(width, row["id"].get<std::string>().size());
  return width;
}

void printCases(const Json& cases) {
  TextTable table({"case", "verdict", "what, expected, then measured"}, false);
  const std::size_t width = kTableWidth - idWidth(cases) - kVerdictWidth - 2 * kGap;
  std::string group;
  for (const Json& row : cases) {
    if (row["group"] != group) {
      if (!group.empty()) table.addRow({});
      group = row["group"].get<std::string>();
    }
    bool first = true;
    for (const char* part : {"case", "expectation", "measured"})
      for (const std::string& line :
           wrapped((part == std::string("measured") ? "-> " : "") + row[part].get<std::string>(),
                   width)) {
        table.addRow({first ? row["id"].get<std::string>() : "",
                      first ? row["verdict"].get<std::string>() : "", line});
        first = false;
      }
  }
  fmt::print("{}", table.text());
}

void printScene(const Json& r) {
  fmt::print("{}", formatFields({{"scene", fmt::format("{}, {}", r["scene"].get<std::string>(),
                                                       r["state"].get<std::string>())},
                                 {"probes", r["probes"].dump()},
                                 {"receivers", r["receivers"].dump()},
                                 {"parameters", r["params"].get<std::string>()},
                                 {"nrmse", formatNumber(r["nrmse"].get<double>())}}));
  TextTable table({"case", "verdict", "what", "expected, then measured"}, false);
  const std::size_t width =
      kTableWidth - idWidth(r["cases"]) - kVerdictWidth - kTitleWidth - 3 * kGap;
  for (const Json& row : r["cases"]) {
    const auto what = wrapped(row["case"].get<std::string>(), kTitleWidth);
    auto right = wrapped(row["expectation"].get<std::string>(), width);
    for (const std::string& line : wrapped("-> " + row["measured"].get<std::string>(), width))
      right.push_back(line);
    for (std::size_t i = 0; i < std::max(what.size(), right.size()); ++i)
      table.addRow({i == 0 ? row["id"].get<std::string>() : "",
                    i == 0 ? row["verdict"].get<std::string>() : "", i < what.size() ? what[i] : "",
                    i < right.size() ? right[i] : ""});
  }
  fmt::print("\n{}", table.text());
}

// What was finished before a signal is printed like a whole result; the exit code tells.
void requireWhole(const Json& result) {
  if (result["interrupted"].get<bool>()) throw Interrupted();
}

// Prints and ends: exit code 3 where a case fails.
void finish(const Invocation& invocation, Json& result, double seconds, bool of_scene) {
  const double cpu_seconds = static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
  result["seconds"] = seconds;
  result["cpu_seconds"] = cpu_seconds;
  reportResult(invocation, result, [&] {
    of_scene ? printScene(result) : printCases(result["cases"]);
    fmt::print("\n{}, {}, {:.1f} s of CPU\n", summary(result["cases"]), formatDuration(seconds),
               cpu_seconds);
    if (of_scene) fmt::print("{}\n", result["trusted"].get<std::string>());
  });
  requireWhole(result);
  std::string failed;
  for (const Json& row : result["cases"])
    if (row["verdict"] == "fails")
      failed += (failed.empty() ? "" : ", ") + row["id"].get<std::string>();
  if (!failed.empty()) throw CaseFails("cases that fail: " + failed);
}

std::vector<PlannedRow> plannedRows(const StabilityOptions& options) {
  std::vector<PlannedRow> planned = planRows(options.name);
  std::erase_if(planned, [&](const PlannedRow& row) {
    return options.scene.tracer != "both" && !row.variant.tracer.empty() &&
           row.variant.tracer != "reference" && row.variant.tracer != options.scene.tracer;
  });
  if (planned.empty())
    throwInput("--case {} has no row of the tracer {}", options.name, options.scene.tracer);
  return planned;
}

Json runSuite(const StabilityOptions& options, const Invocation& invocation) {
  const std::vector<PlannedRow> planned = plannedRows(options);
  Provenance provenance = makeProvenance(invocation);
  GpuContext gpu = openDevice(invocation, provenance);
  if (!gpu.info().ray_query && options.scene.tracer == "rayquery")
    throw DeviceError(gpu.info().name + " has no ray query; use --tracer embree");
  if (!gpu.info().ray_query && options.scene.tracer == "both")
    note(invocation, "{} has no ray query: rows of the tracer rayquery are left out",
         gpu.info().name);
  Progress progress("stability", static_cast<double>(planned.size()), invocation.common.quiet);
  Json cases = Json::array();
  const bool interrupted = endsInterrupted([&] {
    runRows(gpu, planned, [&](const StabilityRow& row) {
      cases.push_back(rowJson(row));
      progress.update(static_cast<double>(cases.size()));
    });
  });
  progress.finish();
  requireNoValidationMessages(gpu);
  provenance.tracer = options.scene.tracer;
  return {{"cases", cases},
          {"interrupted", interrupted},
          {"device", gpu.info().name},
          {"version", buildInfo().version},
          {"provenance", toJson(provenance)}};
}

// Curves are a measurement without a verdict, so nothing here ends with exit code 3.
void runCurvesCommand(const StabilityOptions& options, const Invocation& invocation) {
  const Timer timer;
  Json result = runPrecision(options.name, options.scene.tracer, invocation);
  result["seconds"] = timer.seconds();
  reportResult(invocation, result, [&] {
    printPrecision(result);
    fmt::print("\n{}\n", formatDuration(timer.seconds()));
  });
  requireWhole(result);
}

void requireNoSceneOptions(const StabilityOptions& options) {
  for (const CLI::Option* option : options.of_scene)
    if (option->count() > 0)
      throwInput("{} needs a SCENE: the suite's own cases have their own", option->get_name());
}

void runStability(const StabilityOptions& options, const Invocation& invocation) {
  const Timer timer;
  const bool of_scene = options.scene_option->count() > 0;
  if (of_scene && options.scene.scene.scene.empty())
    throwInput("SCENE is empty; leave it out to run the suite's own scenes");
  if (!of_scene) requireNoSceneOptions(options);
  if (options.curves) return runCurvesCommand(options, invocation);
  Json result = options.long_run ? runLongRun(options.scene, *options.long_run, invocation)
                : of_scene       ? runSceneStability(options.scene, options.name, invocation)
                                 : runSuite(options, invocation);
  finish(invocation, result, timer.seconds(), of_scene);
}

}  // namespace

void addStabilityCommand(Program& program) {
  auto options = std::make_shared<StabilityOptions>();
  CLI::App& app = program.addCommand(
      "stability",
      "the hard-case table: what holds, what fails, and where limits lie (20 % off where this "
      "device's are recorded fails); on a SCENE, the cases that need no special one, and which "
      "digits of its nrmse can be trusted",
      "probelab stability --case geometry",
      [options](const Invocation& invocation) { runStability(*options, invocation); });
  SceneStabilityOptions& scene = options->scene;
  scene.field.probes = kSceneProbes;
  scene.field.updates = kSceneUpdates;
  scene.truth.count = kSceneReceivers;
  options->scene_option =
      app.add_option("SCENE", scene.scene.scene,
                     "a glTF, GLB or scene TOML file; without it, the suite's own scenes");
  app.add_option("--case", options->name,
                 "a row, a case or the beginning of their names ('geometry', 'probe.few'), or a "
                 "pattern with '*' ('*rgb10a2'); default: all")
      ->type_name("NAME")
      ->check(checkNamed);
  app.add_option("--tracer", scene.tracer, "rows of this tracer: embree, rayquery, both")
      ->type_name("NAME")
      ->check(CLI::IsMember({"embree", "rayquery", "both"}).description(""))
      ->capture_default_str();
  app.add_flag("--curves", options->curves,
               "errors over distance, scale, contrast, wall and albedo, and where each curve "
               "leaves its bound, instead of the cases; --case then names curves")
      ->excludes(options->scene_option);
  const std::size_t before = app.get_options().size();
  app.add_option("--long-run", options->long_run,
                 fmt::format("so many updates with hysteresis instead of the cases (a multiple of "
                             "{}): memory, drift from the converged field, stalls",
                             kLongRunStep))
      ->type_name("N")
      ->check(CLI::Range(kLongRunStep, 1000000000).description(""))
      ->excludes(app.get_option("--case"))
      ->group("With a SCENE");
  app.add_option("--state", scene.scene.state, "lighting state of SCENE (default: its first)")
      ->type_name("NAME")
      ->group("With a SCENE");
  app.add_option("--updates", scene.field.updates,
                 fmt::format("updates in the average (default: {})", kSceneUpdates))
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->excludes(app.get_option("--long-run"))
      ->group("With a SCENE");
  addStrategyOptions(app, scene.field);
  addParamsOptions(app, scene.field);
  addTruthOptions(app, scene.truth);
  const std::vector<CLI::Option*> all = app.get_options();
  options->of_scene.assign(all.begin() + static_cast<std::ptrdiff_t>(before), all.end());
  options->of_scene.push_back(app.get_option("--seed"));  // the suite's cases have theirs
}

}  // namespace probelab
