// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab tune`: parameters for a scene, or for several at once, from the error of its probes
// against path tracing; checked on points and under lights that the tuning never saw.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/build_info.h"
#include "base/error.h"
#include "base/files.h"
#include "base/timer.h"
#include "commands.h"
#include "device.h"
#include "field_dump.h"
#include "require.h"
#include "tune_extras.h"
#include "tune_file.h"
#include "tune_report.h"
#include "tune_run.h"
#include "tune_scores.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTableFile = "tune.json";
constexpr const char* kMapFile = "bias_map.csv";

struct TuneOptions {
  std::vector<std::string> scenes;
  TuneSceneOptions of;
  TuneSettings settings;
  std::string output, report, bias_map;
  int bias_map_size = 64;
  std::vector<std::string> vary;
  std::vector<std::string> against = {"rtxgi", "majercik2021", "gdc2019"};
  bool leave_one_out = false;
  std::optional<int> compare_searches;
};

// Everything that runs, made from the options.
struct TuneSession {
  TuneSession(const TuneOptions& options, const Invocation& invocation, Provenance& provenance)
      : gpu(openDevice(invocation, provenance)), fields(gpu, options.of.field, invocation) {}
  TuneSession(const TuneSession&) = delete;

  GpuContext gpu;
  TuneFields fields;
  TuneScenes scenes;
  TuneProblem problem;
  std::vector<std::string> names;  // of the keys
  std::vector<TuneSetting> presets;
};

std::vector<std::string> keyNames(const TuneOptions& options, const Params& from) {
  if (options.vary.empty()) return defaultKeys(from);
  if (options.vary.size() == 1 && options.vary.front() == "none") return {};
  return options.vary;
}

// Presets with the rays that all settings share.
std::vector<TuneSetting> presetSettings(const TuneOptions& options) {
  std::vector<TuneSetting> settings;
  for (const std::string& name : options.against) {
    if (std::any_of(settings.begin(), settings.end(),
                    [&](const TuneSetting& other) { return other.name == name; }))
      throwInput("--against: {} is named twice", name);
    FieldOptions field;
    field.params = name, field.rays = options.of.field.rays;
    settings.push_back({name, resolveParams(field)});
  }
  return settings;
}

std::vector<std::string> outputsOf(const TuneOptions& options) {
  std::vector<std::string> outputs = {options.output};
  if (!options.bias_map.empty()) outputs.push_back(options.bias_map);
  return outputs;
}

// No output may replace what the command reads, nor a TOML file that holds anything but parameters.
void protectFiles(const TuneOptions& options) {
  std::vector<std::string> inputs = options.scenes;
  for (const std::string& file :
       {options.of.field.params, options.of.receivers, options.of.field.layout})
    inputs.push_back(file);
  for (const std::string& output : outputsOf(options))
    for (const std::string& input : inputs) {
      std::error_code ec;  // a file that is missing is not the same as another
      if (fs::equivalent(output, input, ec))
        throwInput("{}: is read by this command; name another output", output);
    }
  std::error_code ec;
  if (!fs::exists(options.output, ec)) return;
  try {
    loadParams(options.output);
  } catch (const InputError&) {
    throwInput("{}: exists already and holds no parameters; name another output", options.output);
  }
}

void checkScenes(const TuneOptions& options) {
  const auto refuse = [&](const std::string& given, const char* flag) {
    if (!given.empty() && options.scenes.size() > 1)
      throwInput("{}: belongs to one scene, and {} are named", flag, options.scenes.size());
  };
  refuse(options.of.receivers, "--receivers");
  refuse(options.of.field.layout, "--layout");
  for (std::size_t i = 0; i < options.scenes.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      if (std::error_code ec; fs::equivalent(options.scenes[i], options.scenes[k], ec))
        throwInput("{}: is named twice", options.scenes[i]);
  if (options.leave_one_out && options.scenes.size() < 2)
    throwInput("--leave-one-out: needs at least two scenes");
  if (!options.of.truth.points.empty())
    throwInput("--points: all of them are held out, so there is nothing to tune on; use --count");
}

void checkOutputs(const TuneOptions& options) {
  checkOutput(options.output, ".toml");
  if (!options.bias_map.empty()) checkOutput(options.bias_map, ".csv");
  if (!options.report.empty()) checkDumpFolder(options.report);
  protectFiles(options);
}

std::vector<TuneSetting> settingsOf(const TuneSession& session, const Params& tuned) {
  std::vector<TuneSetting> settings = {{kFromSetting, session.problem.from},
                                       {kTunedSetting, tuned}};
  settings.insert(settings.end(), session.presets.begin(), session.presets.end());
  return settings;
}

std::vector<PartScore> scoreParts(TuneSession& session, const std::vector<TunePart>& parts,
                                  const Params& tuned, const Invocation& invocation) {
  std::vector<PartScore> scores;
  for (const TunePart& part : parts) {
    note(invocation, "scoring {}, {}", part.scene->scene.name, part.state->scene.state);
    scores.push_back(scorePart(session.fields, part, settingsOf(session, tuned)));
  }
  return scores;
}

std::vector<TuneFold> leaveOneOut(TuneSession& session, const TuneOptions& options,
                                  const Invocation& invocation) {
  std::vector<TuneFold> folds;
  if (!options.leave_one_out) return folds;
  for (const auto& scene : session.scenes) {
    note(invocation, "leaving out {}", scene->scene.name);
    TuneProblem problem = session.problem;
    problem.parts = tuneParts(session.scenes, true, scene.get());
    problem.weights.clear();
    for (std::size_t i = 0; i < session.problem.parts.size(); ++i)
      if (session.problem.parts[i].scene != scene.get())
        problem.weights.push_back(session.problem.weights[i]);
    TuneFold fold;
    fold.scene = scene.get();
    fold.tuned = tuneParams(session.fields, problem, options.settings, invocation);
    std::vector<TunePart> parts;
    for (const TuneState& state : scene->states) parts.push_back({scene.get(), &state});
    fold.scores = scoreParts(session, parts, fold.tuned.params, invocation);
    folds.push_back(std::move(fold));
  }
  return folds;
}

// Keys are checked before any work; those that act on lattices alone once layouts are there.
void prepare(TuneSession& session, const TuneOptions& options) {
  const bool lattice = std::all_of(session.scenes.begin(), session.scenes.end(), [](const auto& s) {
    return s->layout.interpolant == Interpolant::lattice;
  });
  session.problem.keys = tunedKeys(session.names, session.problem.from, lattice);
  session.problem.parts = tuneParts(session.scenes, true);
  session.problem.weights = partWeights(session.fields, session.problem.parts, session.problem.from,
                                        options.settings.objective);
}

struct TuneExtras {
  Json json = Json::object();
  std::string bias_map;
};

TuneExtras makeExtras(TuneSession& session, const TuneOptions& options, const TuneOutcome& outcome,
                      const Invocation& invocation) {
  TuneExtras extras;
  extras.json["bias_map"] = extras.json["searches"] = nullptr;
  const ObjectiveSettings& objective = options.settings.objective;
  if (!options.bias_map.empty() || !options.report.empty()) {
    const Params& tuned = outcome.tuned.params;
    const HeldFields held(session.fields, session.problem, tuned, objective);
    BiasMapResult map =
        mapBiases(held, session.problem.from, tuned, options.bias_map_size, invocation);
    extras.json["bias_map"] = map.json;
    extras.bias_map = map.csv;
  }
  if (options.compare_searches && !session.problem.keys.inner.empty()) {
    const HeldFields held(session.fields, session.problem, session.problem.from, objective);
    extras.json["searches"] = compareSearches(held, session.problem.from, outcome.tuned.first,
                                              *options.compare_searches, invocation.common.seed);
  }
  return extras;
}

Json wholeResult(const TuneOptions& options, const TuneSession& session, const TuneOutcome& outcome,
                 const TuneExtras& extras, double seconds, bool blocks) {
  Json result = {{"output", options.output},
                 {"report", options.report.empty() ? Json(nullptr) : Json(options.report)}};
  result.update(toJson(outcome, blocks));
  result.update(extras.json);
  result["fields"] = session.fields.count();
  result["seconds"] = {
      {"solve", outcome.tuned.solve_s}, {"fields", session.fields.seconds()}, {"all", seconds}};
  result["device"] = outcome.provenance.device;
  result["tracer"] = outcome.provenance.tracer;
  result["seed"] = outcome.provenance.seed;
  result["version"] = outcome.provenance.version;
  result["provenance"] = toJson(outcome.provenance);
  return result;
}

void writeOutputs(const TuneOptions& options, const TuneOutcome& outcome, const TuneExtras& extras,
                  const Json& table, const Invocation& invocation) {
  writeTextFile(options.output, formatTunedFile(outcome, options.of.field.params));
  if (!options.bias_map.empty()) writeTextFile(options.bias_map, extras.bias_map);
  if (!options.report.empty()) {
    writeTextFile(fs::path(options.report) / kTableFile, table.dump(1) + "\n");
    writeTextFile(fs::path(options.report) / kMapFile, extras.bias_map);
  }
  note(invocation, "wrote {}{}", options.output,
       options.report.empty()
           ? ""
           : fmt::format(", {} and {} in {}", kTableFile, kMapFile, options.report));
}

void runTune(TuneOptions options, const Invocation& invocation) {
  const Timer timer;
  checkScenes(options);
  checkOutputs(options);
  checkRequirementNames(invocation.common.require, tuneOutline());
  options.settings.solve.seed = invocation.common.seed;
  const Params from = resolveParams(options.of.field);
  const std::vector<std::string> names = keyNames(options, from);
  tunedKeys(names, from);
  const std::vector<TuneSetting> presets = presetSettings(options);
  Provenance provenance = makeProvenance(invocation);
  TuneSession session(options, invocation, provenance);
  session.names = names, session.presets = presets, session.problem.from = from;
  for (const std::string& path : options.scenes)
    session.scenes.push_back(loadTuneScene(path, options.of, from, names.size(), invocation));
  prepare(session, options);
  TuneOutcome outcome{session.scenes, session.problem, options.against, names, {}, {}, {},
                      provenance};
  outcome.tuned = tuneParams(session.fields, session.problem, options.settings, invocation);
  outcome.scores =
      scoreParts(session, tuneParts(session.scenes, false), outcome.tuned.params, invocation);
  outcome.folds = leaveOneOut(session, options, invocation);
  const TuneExtras extras = makeExtras(session, options, outcome, invocation);
  outcome.provenance.tracer = session.fields.tracer();
  requireNoValidationMessages(session.gpu);
  const double seconds = timer.seconds();
  const auto whole = [&](bool blocks) {
    return wholeResult(options, session, outcome, extras, seconds, blocks);
  };
  writeOutputs(options, outcome, extras, whole(true), invocation);
  reportResult(invocation, whole(false), [&] {
    fmt::print("{}\n{:.0f} s, of which {:.0f} s for {} fields and {:.0f} s of solving\n",
               formatOutcome(outcome), seconds, session.fields.seconds(), session.fields.count(),
               outcome.tuned.solve_s);
  });
}

void addSearchOptions(CLI::App& app, TuneOptions& options) {
  const char* group = "Tuning";
  app.add_option("--vary", options.vary,
                 fmt::format("parameters that are tuned, any continuous one or a count (default: "
                             "{}); none: score only",
                             fmt::join(kDefaultKeys, ",")))
      ->type_name("KEY,KEY")
      ->delimiter(',')
      ->group(group);
  app.add_option("--rounds", options.settings.rounds,
                 "at most so many times: solve on the field held still, run the field again")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str()
      ->group(group);
  app.add_option("--starts", options.settings.solve.starts, "starts of the first solution")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str()
      ->group(group);
  app.add_option("--outer-evaluations", options.settings.outer_evaluations,
                 "fields with other values of the parameters that change the atlases")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str()
      ->group(group);
  app.add_option("--leak-weight", options.settings.objective.leak,
                 "weight of squared light leaks beside the squared error")
      ->type_name("W")
      ->check(checkNotNegative)
      ->capture_default_str()
      ->group(group);
  app.add_option("--robust", options.settings.objective.robust,
                 "errors beyond this many times the scene's own light count linearly; 0: squares")
      ->type_name("X")
      ->check(checkNotNegative)
      ->capture_default_str()
      ->group(group);
  app.add_option("--parsimony", options.settings.parsimony,
                 "parameters stay as they were where, together, that raises the cost by less than "
                 "this share; 0: off")
      ->type_name("X")
      ->check(checkNotNegative)
      ->capture_default_str()
      ->group(group);
  app.add_flag("--leave-one-out", options.leave_one_out,
               "also tune on all scenes but one and score that one, for each")
      ->group(group);
}

void addOutputOptions(CLI::App& app, TuneOptions& options) {
  const char* group = "Output";
  addOutputOption(app, options.output, "TUNED.toml", "the parameters, for --params", true);
  app.add_option("--against", options.against, "presets that are scored beside it")
      ->type_name("PRESET,PRESET")
      ->delimiter(',')
      ->capture_default_str()
      ->group(group);
  app.add_option("--report", options.report,
                 "an existing folder for tune.json (the result with errors by block) and "
                 "bias_map.csv; scripts/tuning_figure.py draws them")
      ->type_name("DIR")
      ->check(checkNamed)
      ->group(group);
  app.add_option("--bias-map", options.bias_map,
                 "cost, nrmse and light leak over normal_bias and view_bias, on train receivers")
      ->type_name("MAP.csv")
      ->check(checkNamed)
      ->group(group);
  app.add_option("--bias-map-size", options.bias_map_size, "values a side of the map")
      ->type_name("N")
      ->check(CLI::Range(2, 1024).description(""))
      ->capture_default_str()
      ->group(group);
  app.add_option("--compare-searches", options.compare_searches,
                 "also search with Nelder-Mead and at random, with so many evaluations each")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->group(group);
}

void addFieldPart(CLI::App& app, TuneOptions& options) {
  options.of.field.params = "probelab";
  addPlacementOptions(app, options.of.field);
  addParamsOptions(app, options.of.field, "--from");
  app.add_option("--updates", options.of.field.updates,
                 fmt::format("updates that are averaged (default: {})", kDefaultAveraged))
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->group("Field");
  addTracingOptions(app, options.of.field);
  CLI::Option* receivers =
      app.add_option("--receivers", options.of.receivers,
                     "receivers with truth, as 'probelab receivers' writes, of one scene and state")
          ->type_name("R.json")
          ->check(checkNamed)
          ->group("Receivers");
  addTruthOptions(app, options.of.truth);
  for (const char* other : {"--count", "--points"}) receivers->excludes(app.get_option(other));
}

}  // namespace

void addTuneCommand(Program& program) {
  auto options = std::make_shared<TuneOptions>();
  CLI::App& app = program.addCommand(
      "tune", "parameters for scenes, found by their error against path tracing",
      "probelab tune scenes/cornell/scene.toml --probes 128 -o tuned.toml",
      [options](const Invocation& invocation) { runTune(*options, invocation); });
  app.add_option("SCENE", options->scenes,
                 "glTF or GLB files, or scene TOMLs; several share one set of parameters")
      ->required();
  app.add_option("--state", options->of.state,
                 "the one lighting state to tune on (default: every train state)")
      ->type_name("NAME")
      ->group("Scene");
  addSearchOptions(app, *options);
  addFieldPart(app, *options);
  addOutputOptions(app, *options);
}

}  // namespace probelab
