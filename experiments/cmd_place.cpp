// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab place`: a layout from a strategy, as a file, with a report; or the smallest budget that
// meets an error.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/build_info.h"
#include "base/error.h"
#include "base/progress.h"
#include "budget_search.h"
#include "commands.h"
#include "ddgi/layout_file.h"
#include "device.h"
#include "drawn_lights.h"
#include "evaluation.h"
#include "field_setup.h"
#include "help.h"
#include "layout_json.h"
#include "layout_source.h"
#include "placement/lighting.h"
#include "placement/report.h"
#include "placement/strategy.h"
#include "probes_glb.h"
#include "require.h"
#include "table.h"
#include "truth.h"

namespace probelab {
namespace {

constexpr int kDefaultLimit = 4096;       // --probes with --max-nrmse
constexpr uint32_t kReportPoints = 4096;  // receivers that the report asks which probes reach them

struct PlaceOptions {
  SceneOptions scene;
  FieldOptions field;
  TruthOptions truth;
  std::string output, glb;
  std::optional<double> max_nrmse;
  std::vector<const CLI::Option*> of_search;  // those that mean nothing without it
  int drawn_lights = 0;  // that the layout is also scored under
  CLI::Option* probes = nullptr;  // to tell whether it was given
};

// The help page with the strategies and the options of the one that is named.
class PlaceHelp : public CLI::FormatterBase {
 public:
  explicit PlaceHelp(std::shared_ptr<PlaceOptions> options) : options_(std::move(options)) {}

  std::string make_help(const CLI::App* app, std::string, CLI::AppFormatMode) const override {
    std::string page = formatHelp(*app, "probelab " + app->get_name());
    page.insert(page.find("\nCommon options"), strategyParts());
    return page;
  }

 private:
  std::string strategyParts() const {
    std::vector<std::pair<std::string, std::string>> known, options;
    for (const Strategy& strategy : strategies())
      known.emplace_back(strategy.name, strategy.description);
    const Strategy& chosen = findStrategy(options_->field.strategy);
    for (const StrategyOption& option : chosen.options)
      options.emplace_back(
          fmt::format("{}={}", option.name, option.range),
          option.fallback.empty()
              ? option.description
              : fmt::format("{} (default: {})", option.description, option.fallback));
    if (options.empty()) options.emplace_back("none", "");
    return formatHelpPart("Strategies", known) +
           formatHelpPart(fmt::format("Options of {} (--option KEY=VALUE)", chosen.name), options);
  }

  std::shared_ptr<PlaceOptions> options_;
};

struct Placed {
  Scene scene;
  ProbeLayout layout;
  std::optional<std::vector<uint8_t>> active;  // [probe], empty: all; none: nobody could say
  Provenance provenance;
  Json report;
  Json search = nullptr;  // of --max-nrmse
};

Json spreadJson(const Spread& spread) {
  return {{"min", spread.min},
          {"p5", spread.p5},
          {"median", spread.median},
          {"p95", spread.p95},
          {"max", spread.max}};
}

Json reportJson(const ProbeLayout& layout, const PlacementScene& of, uint64_t seed) {
  std::vector<Vec3f> points;
  for (const Receiver& r :
       generateReceivers(of.scene, of.embree, of.reachability, kReportPoints, seed).points)
    points.push_back(r.position);
  const LayoutReport report = layoutReport(layout, of.scene, of.embree, points);
  Json reached = Json::object();
  for (std::size_t i = 0; i < report.reached.size(); ++i)
    reached[std::to_string(LayoutReport::kReached[i])] = report.reached[i];
  return {{"inside_geometry", report.inside_geometry},
          {"pinned", report.pinned},
          {"clearance_m", report.has_clearance ? spreadJson(report.clearance_m) : Json(nullptr)},
          {"spacing_m", report.stored > 1 ? spreadJson(report.spacing_m) : Json(nullptr)},
          {"reached", reached}};
}

// "drawn_lights" of the result; null where none are asked for. Apart from the placing, so that the
// layout is a file by then.
Json drawnJson(const PlaceOptions& options, const Scene& scene, const ProbeLayout& layout,
               const Params& params, const Invocation& invocation) {
  if (options.drawn_lights == 0) return nullptr;
  note(invocation, "scoring under {} drawn lights", options.drawn_lights);
  const EmbreeScene embree(scene);
  const Reachability reachability = findReachable(scene, embree);
  return toJson(scoreDrawnLights({scene, embree, reachability}, layout, params,
                                 options.drawn_lights, invocation.common.seed));
}

// One budget of the search.
struct Trial {
  ProbeLayout layout;
  std::vector<uint8_t> active;
  std::optional<double> train, heldout;
};

Trial tryBudget(SceneSetup& setup, const Params& params, const FieldOptions& options,
                const Receivers& receivers, const Invocation& invocation) {
  const std::unique_ptr<ProbeField> field = makeField(
      setup, params,
      {.options = options, .seed = invocation.common.seed, .cache = invocation.common.cache});
  runField(*field, options, invocation);
  const std::vector<Vec3f> estimates = queryReceivers(*field, receivers);
  return {field->layout(), field->states().active,
          scoreEstimates(estimates, receivers, ScoredSplit::train).all.nrmse,
          scoreEstimates(estimates, receivers, ScoredSplit::heldout).all.nrmse};
}

Json searchJson(const BudgetSearch& search, const std::map<int, Trial>& trials, double wanted) {
  Json steps = Json::array();
  for (const BudgetStep& step : search.steps) {
    const auto trial = trials.find(step.probes);
    const bool placed = trial != trials.end();
    steps.push_back({{"probes", step.probes},
                     {"stored", placed ? Json(trial->second.layout.positions.size()) : Json()},
                     {"train_nrmse", optionalNumber(step.error)},
                     {"heldout_nrmse", placed ? optionalNumber(trial->second.heldout) : Json()}});
  }
  const Trial& best = trials.at(search.probes);
  return {{"max_nrmse", wanted},
          {"met", search.met},
          {"probes", search.probes},
          {"train_nrmse", optionalNumber(best.train)},
          {"heldout_nrmse", optionalNumber(best.heldout)},
          {"heldout_met", best.heldout && *best.heldout <= wanted},
          {"steps", steps}};
}

Placed placeByError(const PlaceOptions& options, const Params& params,
                    const Invocation& invocation) {
  SceneSetup setup(options.scene, invocation);
  const Receivers receivers =
      obtainTruth(options.truth, setup.scene, setup.embree, setup.reachability, invocation)
          .receivers;
  for (const Split split : {Split::train, Split::heldout})
    if (std::none_of(receivers.points.begin(), receivers.points.end(),
                     [&](const Receiver& r) { return r.split == split; }))
      throwInput("--max-nrmse: no {} receivers; use --count in place of --points, or a larger one",
                 split == Split::train ? "train" : "held-out");
  const int limit = options.probes->count() > 0 ? options.field.probes : kDefaultLimit;
  std::map<int, Trial> trials;
  std::string refusal;
  const BudgetSearch search = searchBudget(*options.max_nrmse, limit, [&](int probes) {
    FieldOptions sized = options.field;
    sized.probes = probes;
    std::optional<double> train;
    bool placed = false;
    try {
      train = trials.emplace(probes, tryBudget(setup, params, sized, receivers, invocation))
                  .first->second.train;
      placed = true;
    } catch (const InputError& error) {
      refusal = error.what();
    }
    // So it is for every budget.
    if (placed && !train)
      throwInput(
          "--max-nrmse: no train receiver gets light in state '{}', and nrmse is undefined "
          "without light; add a light, or choose another --state",
          setup.scene.state);
    note(invocation, "at most {} probes: {}", probes,
         train ? fmt::format("nrmse {} on train receivers", formatNumber(*train)) : refusal);
    return train;
  });
  if (search.probes == 0) throwInput("{}", refusal);
  requireNoValidationMessages(setup.gpu);
  const Trial& best = trials.at(search.probes);
  return {setup.scene,
          best.layout,
          best.active,
          setup.provenance,
          reportJson(best.layout, {setup.scene, setup.embree, setup.reachability},
                     invocation.common.seed),
          searchJson(search, trials, *options.max_nrmse)};
}

// Classification needs a device; without classification all probes are active. None where there is
// no device and none is `needed`.
std::optional<std::vector<uint8_t>> activeProbes(const ProbeLayout& layout, const Params& params,
                                                 const PlacementScene& of, bool needed,
                                                 Provenance& provenance,
                                                 const Invocation& invocation) {
  if (params.classification == 0) return std::vector<uint8_t>{};
  std::optional<GpuContext> gpu;
  try {
    gpu.emplace(openDevice(invocation, provenance));
  } catch (const DeviceError& error) {
    if (needed) throw;
    note(invocation, "active probes are not counted: {}", error.what());
    return std::nullopt;
  }
  const ProbeField field(*gpu, of.scene, of.embree, layout, params,
                         {.seed = invocation.common.seed, .accumulate = false});
  requireNoValidationMessages(*gpu);
  return field.states().active;
}

Placed placeBudget(const PlaceOptions& options, const Params& params,
                   const Invocation& invocation) {
  Placed placed;
  const Scene& scene = placed.scene = loadScene(options.scene, invocation);
  const EmbreeScene embree(scene);
  const Reachability reachability = findReachable(scene, embree);
  const PlacementScene of{scene, embree, reachability};
  placed.provenance = makeProvenance(invocation, scene);
  Progress progress("layout", 1, invocation.common.quiet);
  placed.layout =
      obtainLayout(of, options.field, params, invocation.common.seed, invocation.common.cache,
                   [&](double done) { progress.update(done); });
  progress.finish();
  validateLayout(placed.layout, params);
  placed.report = reportJson(placed.layout, of, invocation.common.seed);
  const bool needed = !options.glb.empty() || !invocation.common.device.empty();
  placed.active =
      activeProbes(placed.layout, params, of, needed, placed.provenance, invocation);
  return placed;
}

// Null where nobody could say.
Json activeCount(const Placed& placed) {
  if (!placed.active) return nullptr;
  if (placed.active->empty()) return placed.layout.positions.size();
  return std::count(placed.active->begin(), placed.active->end(), 1);
}

std::string formatError(const Json& error) {
  return error.is_null() ? "-" : formatNumber(error.get<double>());
}

std::string formatSearch(const Json& search) {
  TextTable table({"at most", "stored", "train nrmse", "held-out nrmse"});
  for (const Json& step : search["steps"])
    table.addRow({step["probes"].dump(), step["stored"].is_null() ? "-" : step["stored"].dump(),
                  formatError(step["train_nrmse"]), formatError(step["heldout_nrmse"])});
  return table.text();
}

std::string formatSpread(const Json& spread) {
  if (spread.is_null()) return "-";
  const auto of = [&](const char* name) { return formatNumber(spread[name].get<double>()); };
  return fmt::format("{} m (least {}, 5 % {}, 95 % {}, most {})", of("median"), of("min"), of("p5"),
                     of("p95"), of("max"));
}

std::string formatDrawn(const Json& drawn) {
  std::vector<double> errors;
  for (const Json& light : drawn["each"]) errors.push_back(light["nrmse"].get<double>());
  std::ranges::sort(errors);
  return fmt::format("nrmse {} under {} (least {}, median {}, most {}), {} held-out receivers",
                     formatError(drawn["nrmse"]), errors.size(), formatNumber(errors.front()),
                     formatNumber(percentile(errors, 0.5)), formatNumber(errors.back()),
                     drawn["receivers"].dump());
}

std::string formatReading(const Json& reading) {
  return fmt::format("nrmse {} under every other one; weights for each receiver {}, for these very "
                     "lights {}",
                     formatError(reading["nrmse"]), formatError(reading["unseen"]),
                     formatError(reading["seen"]));
}

std::string formatReached(const Json& reached) {
  std::string text;
  for (const auto& [count, share] : reached.items()) {
    const std::string percent = fmt::format("{:.1f} %", 100 * share.get<double>());
    text += count == "0" ? percent + " by none" : fmt::format(", {} by {} or more", percent, count);
  }
  return text;
}

std::string formatIndex(const Json& layout) {
  const std::string bytes = formatBytes(layout["index_bytes"].get<double>());
  const Json& voxels = layout["voxels"];
  if (voxels.is_null()) return bytes;
  const auto edge = [&](int axis) { return formatNumber(voxels["edges_m"][axis].get<double>()); };
  return fmt::format("{}, {} x {} x {} voxels of {} x {} x {} m", bytes, voxels["count"][0].dump(),
                     voxels["count"][1].dump(), voxels["count"][2].dump(), edge(0), edge(1),
                     edge(2));
}

void printPlaced(const Json& r) {
  const Json& layout = r["layout"];
  std::vector<std::pair<std::string, std::string>> fields = {
      {"scene",
       fmt::format("{}, {}", r["scene"].get<std::string>(), r["state"].get<std::string>())},
      {"probes", formatLayout(r)},
      {"options", formatOptions(layout["options"])},
      {"in solid geometry", r["report"]["inside_geometry"].dump()},
      {"clearance", formatSpread(r["report"]["clearance_m"])},
      {"spacing", formatSpread(r["report"]["spacing_m"])},
      {"receivers reached", formatReached(r["report"]["reached"])},
      {"index", formatIndex(layout)},
      {"built in", formatNumber(layout["build_s"].get<double>()) + " s"},
      {"evaluations", layout["evaluations"].dump()}};
  if (const Json& drawn = r["drawn_lights"]; !drawn.is_null()) {
    fields.emplace_back("drawn lights", formatDrawn(drawn));
    if (!drawn["reading"].is_null())
      fields.emplace_back("what reading bounds", formatReading(drawn["reading"]));
  }
  fmt::print("{}", formatFields(fields));
  const Json& search = r["search"];
  if (search.is_null()) return;
  fmt::print("\n{}\n", formatSearch(search));
  fmt::print("{}",
             formatFields({{"wanted", "nrmse <= " + search["max_nrmse"].dump()},
                           {search["met"].get<bool>() ? "found" : "the best",
                             fmt::format("at most {} probes", search["probes"].dump())},
                           {"on train receivers", formatError(search["train_nrmse"])},
                           {"on held-out receivers", formatError(search["heldout_nrmse"])}}));
}

void requireError(const Json& search) {
  if (search.is_null()) return;
  const double wanted = search["max_nrmse"].get<double>();
  if (!search["met"].get<bool>())
    throw RequirementNotMet(
        fmt::format("not met: nrmse <= {:g} with up to {} probes; the best, {:.4g} with {}, is "
                    "written; raise --probes",
                    wanted, search["steps"].back()["probes"].get<int>(),
                    search["train_nrmse"].get<double>(), search["probes"].get<int>()));
  if (!search["heldout_met"].get<bool>())
    throw RequirementNotMet(fmt::format(
        "not met on held-out receivers: {} with {} probes, which meet nrmse <= {:g} on train "
        "receivers; the layout is written",
        formatError(search["heldout_nrmse"]), search["probes"].get<int>(), wanted));
}

// The result's numbers before there are any.
Json outlineOf() {
  return {{"probes", {{"stored", 0}, {"active", 0}}},
          {"layout", layoutJson(ProbeLayout{})},
          {"report", Json::object()},
          {"search", Json::object()},
          {"drawn_lights", Json::object()},
          {"seed", 0}};
}

// No output may replace what the command reads, nor a GLB that holds anything but probes.
void protectFiles(const PlaceOptions& options, const OptionValues& strategy_options) {
  namespace fs = std::filesystem;
  const auto path = strategy_options.find("path");
  const std::string probes = path == strategy_options.end() ? "" : path->second;
  for (const std::string& output : {options.output, options.glb}) {
    std::error_code ec;  // a file that is missing is not the same as another
    if (fs::equivalent(output, options.scene.scene, ec))
      throwInput("{}: is the scene; name another output", output);
    if (fs::equivalent(output, probes, ec))
      throwInput("{}: is read as --option path; name another output", output);
  }
  std::error_code ec;
  if (fs::exists(options.glb, ec) && !isProbesGlb(options.glb))
    throwInput(
        "--glb {}: exists already and is no file of probes that probelab wrote; name another",
        options.glb);
}

void runPlace(const PlaceOptions& options, const Invocation& invocation) {
  for (const CLI::Option* option : options.of_search)
    if (!options.max_nrmse && option->count() > 0)
      throwInput("{} is for --max-nrmse; strategies that read truth have receivers of their own",
                 option->get_name());
  checkOutput(options.output, ".json");
  if (!options.glb.empty()) checkOutput(options.glb, ".glb");
  checkRequirementNames(invocation.common.require, outlineOf());
  const Params params = resolveParams(options.field);
  protectFiles(options, resolveOptions(findStrategy(options.field.strategy),
                                       strategyOptionPairs(options.field)));
  const Placed placed = options.max_nrmse ? placeByError(options, params, invocation)
                                          : placeBudget(options, params, invocation);
  const Scene& scene = placed.scene;
  writeLayout(options.output, placed.layout, scene);
  if (!options.glb.empty()) writeProbesGlb(options.glb, placed.layout, scene, *placed.active);
  note(invocation, "wrote {}{}", options.output, options.glb.empty() ? "" : " and " + options.glb);
  Json result = {{"output", options.output},
                 {"glb", options.glb.empty() ? Json(nullptr) : Json(options.glb)},
                 {"scene", scene.name},
                 {"state", placed.provenance.state},
                 {"strategy", placed.layout.strategy},
                 {"probes",
                  {{"stored", placed.layout.positions.size()}, {"active", activeCount(placed)}}},
                 {"lattice", latticeJson(placed.layout)},
                 {"layout", layoutJson(placed.layout)},
                 {"report", placed.report},
                 {"params", params.name},
                 {"search", placed.search},
                 {"drawn_lights", drawnJson(options, scene, placed.layout, params, invocation)},
                 {"seed", placed.layout.seed},
                 {"version", buildInfo().version},
                 {"provenance", toJson(placed.provenance)}};
  reportResult(invocation, result, [&] { printPlaced(result); });
  requireError(placed.search);
}

}  // namespace

void addPlaceCommand(Program& program) {
  auto options = std::make_shared<PlaceOptions>();
  CLI::App& app = program.addCommand(
      "place", "a probe layout from a strategy, as a file, with a report of it",
      "probelab place scenes/cornell/scene.toml --strategy grid --probes 128 -o layout.json",
      [options](const Invocation& invocation) { runPlace(*options, invocation); });
  app.formatter(std::make_shared<PlaceHelp>(options));
  addSceneOptions(app, options->scene, false);
  addOutputOption(app, options->output, "LAYOUT.json",
                  "the layout, for --layout of render, evaluate and bench", true);
  app.add_option("--glb", options->glb,
                 "the probes as octahedra coloured by state, for a modeller and for strategy file")
      ->type_name("PROBES.glb")
      ->check(checkNamed)
      ->group("Output");
  addStrategyOptions(app, options->field);
  options->probes = app.get_option("--probes");
  app.add_option("--max-nrmse", options->max_nrmse,
                 fmt::format("instead of a budget: the smallest one whose field meets this error "
                             "on train receivers (found by doubling and bisection, checked on "
                             "held-out ones), up to --probes (then default: {}); exits with 3 "
                             "where it is not met",
                             kDefaultLimit))
      ->type_name("E")
      ->check(checkPositive)
      ->group("Probes");
  app.add_option("--drawn-lights", options->drawn_lights,
                 "also score the layout under so many lights drawn from the scene (lamps, suns, "
                 "the sky) that no strategy saw, at held-out receivers: how it answers light that "
                 "may be anywhere")
      ->type_name("N")
      ->check(CLI::Range(1, static_cast<int>(kMostStates)).description(""))
      ->group("Probes");
  addParamsOptions(app, options->field);
  app.add_option(
         "--updates", options->field.updates,
         fmt::format("updates that are averaged with --max-nrmse (default: {})", kDefaultAveraged))
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->group("Field");
  addTracingOptions(app, options->field);
  const std::size_t before = app.get_options().size();
  addTruthOptions(app, options->truth);
  const std::vector<CLI::Option*> all = app.get_options();
  options->of_search.assign(all.begin() + static_cast<std::ptrdiff_t>(before), all.end());
  options->of_search.push_back(app.get_option("--updates"));
}

}  // namespace probelab
