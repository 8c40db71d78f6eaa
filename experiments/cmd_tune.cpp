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
#include "base/interrupt.h"
#include "base/timer.h"
#include "commands.h"
#include "device.h"
#include "require.h"
#include "tune_extras.h"
#include "tune_file.h"
#include "tune_options.h"
#include "tune_report.h"
#include "tune_run.h"
#include "tune_scores.h"
#include "tune_values.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

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

void leaveOneOut(TuneSession& session, const TuneOptions& options, const Invocation& invocation,
                 std::vector<TuneFold>& folds) {
  if (!options.leave_one_out) return;
  for (const auto& scene : session.scenes) {
    throwIfInterrupted();
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
  Json json = {{"bias_map", nullptr}, {"searches", nullptr}, {"values", nullptr}};
  std::string bias_map;  // CSV; empty: none
  std::optional<FittedValues> values;
};

void makeExtras(TuneSession& session, const TuneOptions& options, const TuneOutcome& outcome,
                const Invocation& invocation, TuneExtras& extras) {
  throwIfInterrupted();
  const ObjectiveSettings& objective = options.settings.objective;
  const bool map_wanted = !options.bias_map.empty() || !options.report.empty();
  if (map_wanted && options.bias_map_size > 0) {
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
  if (!options.fit_values.empty()) {
    extras.values = fitFieldValues(session.fields, *session.scenes.front(), outcome.tuned.params);
    extras.json["values"] = toJson(*extras.values);
  }
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
  if (!options.bias_map.empty() && !extras.bias_map.empty())
    writeTextFile(options.bias_map, extras.bias_map);
  if (!options.report.empty()) {
    writeTextFile(fs::path(options.report) / kTuneTableFile, table.dump(1) + "\n");
    if (!extras.bias_map.empty())
      writeTextFile(fs::path(options.report) / kTuneMapFile, extras.bias_map);
  }
  if (extras.values) writeValues(options.fit_values, extras.values->values);
  std::vector<std::string> written = {options.output};
  if (!options.bias_map.empty() && !extras.bias_map.empty()) written.push_back(options.bias_map);
  if (extras.values) written.push_back(options.fit_values);
  if (!options.report.empty()) written.push_back(options.report);
  note(invocation, "wrote {}", fmt::join(written, ", "));
}

void runTune(TuneOptions options, const Invocation& invocation) {
  const Timer timer;
  checkTuneOptions(options);
  checkRequirementNames(invocation.common.require, tuneOutline());
  options.settings.solve.seed = invocation.common.seed;
  const Params from = resolveParams(options.of.field);
  const std::vector<std::string> names = keyNames(options, from);
  if (tunedKeys(names, from).inner.empty() && options.compare_searches)
    throwInput("--compare-searches: --vary names no parameter of the query to search for");
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
  TuneExtras extras;
  // The parameters are worth keeping without what comes after them.
  const bool interrupted = endsInterrupted([&] {
    leaveOneOut(session, options, invocation, outcome.folds);
    makeExtras(session, options, outcome, invocation, extras);
  });
  outcome.provenance.tracer = session.fields.tracer();
  requireNoValidationMessages(session.gpu);
  const double seconds = timer.seconds();
  const auto whole = [&](bool blocks) {
    return wholeResult(options, session, outcome, extras, seconds, blocks);
  };
  writeOutputs(options, outcome, extras, whole(true), invocation);
  reportResult(invocation, whole(false), [&] {
    fmt::print("{}", formatOutcome(outcome));
    if (extras.values) fmt::print("\n{}", formatValues(*extras.values));
    fmt::print("\n{:.0f} s, of which {:.0f} s for {} fields and {:.0f} s of solving\n", seconds,
               session.fields.seconds(), session.fields.count(), outcome.tuned.solve_s);
  });
  if (interrupted) throw Interrupted();
}

}  // namespace

void addTuneCommand(Program& program) {
  auto options = std::make_shared<TuneOptions>();
  CLI::App& app = program.addCommand(
      "tune", "parameters for scenes, found by their error against path tracing",
      "probelab tune scenes/cornell/scene.toml --probes 128 -o tuned.toml",
      [options](const Invocation& invocation) { runTune(*options, invocation); });
  addTuneOptions(app, *options);
}

}  // namespace probelab
