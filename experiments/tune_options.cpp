// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <set>

#include "base/error.h"
#include "base/files.h"
#include "common_options.h"
#include "tuning/values_file.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

std::string checkMapSize(const std::string& text) {
  if (text == "0") return "";
  const std::string wrong = checkPositiveInteger(text);
  if (!wrong.empty()) return wrong;
  const int size = std::stoi(text);
  return size < 2 || size > 1024 ? "a map has 2 to 1024 values a side, or 0 for none" : "";
}

std::string checkFolds(const std::string& text) {
  const std::string wrong = "there are 2 to 16 folds, or 0 for none";
  if (text == "0") return "";
  if (!checkPositiveInteger(text).empty()) return wrong;
  const int folds = std::stoi(text);
  return folds < 2 || folds > 16 ? wrong : "";
}

std::vector<std::string> outputsOf(const TuneOptions& options) {
  std::vector<std::string> outputs = {options.output};
  for (const std::string& file : {options.bias_map, options.fit_values})
    if (!file.empty()) outputs.push_back(file);
  if (!options.report.empty())
    for (const char* file : {kTuneTableFile, kTuneMapFile})
      outputs.push_back((fs::path(options.report) / file).string());
  return outputs;
}

// No output may replace what the command reads, nor a TOML file that holds anything but parameters.
void protectFiles(const TuneOptions& options) {
  std::vector<std::string> inputs = options.scenes;
  for (const std::string& file :
       {options.of.field.params, options.of.receivers, options.of.field.layout})
    inputs.push_back(file);
  inputs.insert(inputs.end(), options.against.begin(), options.against.end());
  for (const std::string& option : options.of.field.option)  // files that strategies read
    inputs.push_back(option.substr(option.find('=') + 1));
  const std::vector<std::string> outputs = outputsOf(options);
  std::set<fs::path> targets;
  for (const std::string& output : outputs)
    if (!targets.insert(plainPath(output)).second)
      throwInput("{}: two outputs of this command go there; name another", output);
  for (const std::string& output : outputs)
    for (const std::string& input : inputs) {
      std::error_code ec;  // a file that is missing is not the same as another
      if (fs::equivalent(output, input, ec))
        throwInput("{}: is read by this command; name another output", output);
    }
  std::error_code ec;
  if (!options.fit_values.empty() && fs::exists(options.fit_values, ec)) {
    try {
      readValues(options.fit_values);
    } catch (const InputError&) {
      throwInput("{}: exists already and holds no fitted values; name another output",
                 options.fit_values);
    }
  }
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
  if (!options.fit_values.empty() && options.scenes.size() > 1)
    throwInput("--fit-values: belongs to one scene, and {} are named", options.scenes.size());
  if (options.leave_one_out && options.scenes.size() < 2)
    throwInput("--leave-one-out: needs at least two scenes");
  if (!options.of.truth.points.empty())
    throwInput("--points: all of them are held out, so there is nothing to tune on; use --count");
}

void checkOutputs(const TuneOptions& options) {
  checkOutput(options.output, ".toml");
  if (!options.bias_map.empty()) {
    if (options.bias_map_size == 0)
      throwInput("--bias-map {}: --bias-map-size 0 draws none; leave one of them out",
                 options.bias_map);
    checkOutput(options.bias_map, ".csv");
  }
  if (!options.fit_values.empty()) checkOutput(options.fit_values, ".json");
  if (!options.report.empty()) {
    if (!isFolder(options.report))
      throwInput("--report {}: no such folder; make it first", options.report);
    checkWritable(fs::path(options.report) / kTuneTableFile);
  }
  protectFiles(options);
}

void addSearchOptions(CLI::App& app, TuneOptions& options) {
  const char* group = "Tuning";
  app.add_option("--vary", options.vary,
                 fmt::format("parameters that are tuned, any continuous one or a count (default: "
                             "{}); none: score only",
                             fmt::join(kDefaultKeys, ", ")))
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
      ->check(CLI::Range(1, options.settings.solve.candidates + 1))
      ->capture_default_str()
      ->group(group);
  app.add_option("--outer-evaluations", options.settings.outer_evaluations,
                 "fields with other values of the parameters that change the atlases")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str()
      ->group(group);
  app.add_option("--leak-weight", options.settings.objective.leak,
                 "weight of light leaks beside the squared error")
      ->type_name("W")
      ->check(checkNotNegative)
      ->capture_default_str()
      ->group(group);
  app.add_option("--shadow-weight", options.settings.objective.shadow,
                 "weight of shadow leaks beside the squared error")
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
  app.add_option("--folds", options.settings.folds,
                 "cross-validation: so many parts of the train receivers (from three scenes on the "
                 "scenes instead) are left out by turns, and values of query parameters go no "
                 "farther towards the solution than pays there; 0: all of the way")
      ->type_name("K")
      ->check(checkFolds)
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
      ->default_str(fmt::format("{}", fmt::join(options.against, ",")))
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
  app.add_option("--bias-map-size", options.bias_map_size, "values a side of the map; 0: none")
      ->type_name("N")
      ->check(checkMapSize)
      ->capture_default_str()
      ->group(group);
  app.add_option("--fit-values", options.fit_values,
                 "also fit the irradiance texels to the first state that is tuned on, for --values "
                 "of render and evaluate; under other lights they gain or lose")
      ->type_name("VALUES.json")
      ->check(checkNamed)
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

void addTuneOptions(CLI::App& app, TuneOptions& options) {
  app.add_option("SCENE", options.scenes,
                 "glTF or GLB files, or scene TOMLs; several share one set of parameters")
      ->required();
  app.add_option("--state", options.of.state,
                 "the one lighting state to tune on (default: every train state)")
      ->type_name("NAME")
      ->group("Scene");
  addSearchOptions(app, options);
  addFieldPart(app, options);
  addOutputOptions(app, options);
}

void checkTuneOptions(const TuneOptions& options) {
  checkScenes(options);
  checkOutputs(options);
}

}  // namespace probelab
