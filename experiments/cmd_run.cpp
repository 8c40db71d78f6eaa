// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab run`: a study, cell by cell; what is already there is kept.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/build_info.h"
#include "base/error.h"
#include "base/files.h"
#include "base/progress.h"
#include "commands.h"
#include "common_options.h"
#include "require.h"
#include "study.h"
#include "study_run.h"
#include "table.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

struct RunOptions {
  std::string study, results, cell, size;
  int jobs = 1, scale = 1;
  bool list = false;
  CLI::App* app = nullptr;      // of this command; its parent knows the others
  CLI::Option* seed = nullptr;  // which every command has
};

fs::path resultsFolder(const RunOptions& options) {
  if (!options.results.empty()) return options.results;
  return fs::path("results/runs") / fs::path(options.study).stem();
}

Json listJson(const Study& study, const StudyRun& run) {
  std::vector<std::optional<Json>> results;
  for (const StudyCell& cell : study.cells) results.push_back(readCell(run, cell));
  Json cells = Json::array();
  for (std::size_t i = 0; i < study.cells.size(); ++i) {
    Json axes = Json::object();
    for (const auto& [name, value] : study.cells[i].axes) axes[name] = value;
    cells.push_back({{"id", study.cells[i].id},
                     {"axes", axes},
                     {"done", results[i].has_value()},
                     {"seconds", estimateSeconds(study, study.cells[i], results)}});
  }
  return cells;
}

void printList(const Study& study, const Json& cells) {
  std::vector<std::string> header = {"id"};
  header.insert(header.end(), study.axes.begin(), study.axes.end());
  header.insert(header.end(), {"done", "seconds"});
  TextTable table(header);
  double left = 0;
  for (const Json& cell : cells) {
    std::vector<std::string> row = {cell["id"].get<std::string>()};
    for (const auto& [name, value] : cell["axes"].items()) row.push_back(value.get<std::string>());
    const bool done = cell["done"].get<bool>();
    const double seconds = cell["seconds"].get<double>();
    if (!done) left += seconds;
    row.insert(row.end(), {done ? "yes" : "-", fmt::format("{}{:.0f}", done ? "" : "~", seconds)});
    table.addRow(row);
  }
  fmt::print("{}\n{} cells, about {} left one at a time\n", table.text(), cells.size(),
             formatDuration(left));
}

std::vector<const StudyCell*> chosenCells(const Study& study, const RunOptions& options) {
  std::vector<const StudyCell*> cells;
  std::vector<std::string> ids;
  for (const StudyCell& cell : study.cells) {
    if (options.cell.empty() || cell.id == options.cell) cells.push_back(&cell);
    ids.push_back(cell.id);
  }
  if (cells.empty())
    throwInput("--cell: the study has no cell '{}'; see 'probelab run {} --list'", options.cell,
               options.study);
  return cells;
}

Json outcomeJson(const Study& study, const StudyRun& run, const StudyOutcome& outcome) {
  Json failed = Json::array();
  for (const StudyFailure& failure : outcome.failures)
    failed.push_back({{"id", failure.cell->id}, {"error", failure.error}});
  return {{"study", study.name},
          {"cells", study.cells.size()},
          {"done", outcome.done},
          {"found", outcome.found},
          {"failed", failed},
          {"seconds", outcome.seconds},
          {"results", run.folder.string()},
          {"version", buildInfo().version}};
}

std::vector<std::string> optionNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back(name);
  return names;
}

void runStudy(const RunOptions& options, const Invocation& invocation) {
  if (options.seed->count() > 0)
    throwInput("--seed: the study names its seeds; --scale K takes K times as many");
  const Study study =
      loadStudy(options.study, {options.size, options.scale, invocation.common.device});
  checkOptionNames(study, [&](const std::string& command) {
    return optionNames(*options.app->get_parent()->get_subcommand(command));
  });
  const StudyRun run = {resultsFolder(options), options.jobs};
  if (options.list) {
    const Json cells = listJson(study, run);
    const Json json = {{"study", study.name}, {"about", study.about}, {"list", cells}};
    reportResult(invocation, json, [&] { printList(study, cells); });
    return;
  }
  const std::vector<const StudyCell*> cells = chosenCells(study, options);
  const StudyOutcome outcome = runCells(study, cells, run, invocation);
  const fs::path table = run.folder / (study.name + ".csv");
  if (options.cell.empty()) writeTextFile(table, studyTable(study, run));
  const Json json = outcomeJson(study, run, outcome);
  reportResult(invocation, json, [&] {
    fmt::print(
        "{}",
        formatFields({{"study", study.about},
                      {"cells", fmt::format("{} computed, {} found, {} failed", outcome.done,
                                            outcome.found, outcome.failures.size())},
                      {"time", formatDuration(outcome.seconds)},
                      {"results", options.cell.empty() ? table.string() : run.folder.string()}}));
  });
  if (!outcome.failures.empty())
    throw Error(fmt::format("{} of {} cells failed, first {}: {}; their logs are in {}",
                            outcome.failures.size(), cells.size(), outcome.failures[0].cell->id,
                            outcome.failures[0].error, (run.folder / "logs").string()));
}

}  // namespace

void addRunCommand(Program& program) {
  auto options = std::make_shared<RunOptions>();
  CLI::App& app = program.addCommand(
      "run", "a study: many runs of a command, resumable, one result file each",
      "probelab run experiments/studies/error_vs_n.toml --size smoke --jobs 2",
      [options](const Invocation& invocation) { runStudy(*options, invocation); });
  options->app = &app;
  options->seed = app.get_option("--seed")->group("");  // hidden: the study names its seeds
  app.add_option("study", options->study, "which cells there are (experiments/studies)")
      ->type_name("STUDY.toml")
      ->required();
  app.add_option("--results", options->results,
                 "folder of the results (default: results/runs/<study>)")
      ->type_name("DIR")
      ->check(checkNamed);
  app.add_option("--size", options->size, "a part of the study that its file names, such as smoke")
      ->type_name("NAME")
      ->check(checkNamed);
  app.add_option("--scale", options->scale,
                 "that many times the seeds, and the receivers where the study's options say "
                 "'count'")
      ->type_name("K")
      ->check(checkPositiveInteger)
      ->capture_default_str();
  app.add_option("--jobs", options->jobs, "cells at a time; times mean little beyond one")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str();
  CLI::Option* cell = app.add_option("--cell", options->cell, "this one alone, as --list names it")
                          ->type_name("ID")
                          ->check(checkNamed);
  app.add_flag("--list", options->list, "print the cells and how long they take, run nothing")
      ->excludes(cell);
}

}  // namespace probelab
