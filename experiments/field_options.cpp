// SPDX-License-Identifier: GPL-3.0-or-later
#include "field_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "base/error.h"
#include "common_options.h"
#include "placement/strategy.h"

namespace probelab {
namespace {

std::string checkStrategy(const std::string& name) {
  try {
    findStrategy(name);
    return "";
  } catch (const InputError& error) {
    return error.what();
  }
}

}  // namespace

void addStrategyOptions(CLI::App& app, FieldOptions& options) {
  const char* group = "Probes";
  std::vector<std::string> names;
  for (const Strategy& strategy : strategies()) names.push_back(strategy.name);
  app.add_option("--strategy", options.strategy,
                 fmt::format("how probes are placed: {}", fmt::join(names, ", ")))
      ->type_name("NAME")
      ->check(checkStrategy)
      ->capture_default_str()
      ->group(group);
  app.add_option("--probes", options.probes, "at most this many probes that own texels")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str()
      ->group(group);
  app.add_option("--option", options.option,
                 "an option of the strategy; may be repeated; 'probelab place --strategy NAME "
                 "--help' lists them")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false)
      ->group(group);
}

void addPlacementOptions(CLI::App& app, FieldOptions& options) {
  const char* group = "Probes";
  CLI::Option* layout =
      app.add_option("--layout", options.layout,
                     "a layout, as 'probelab place' writes, instead of the other options here")
          ->type_name("LAYOUT.json")
          ->check(checkNamed)
          ->group(group);
  addStrategyOptions(app, options);
  app.add_option("--lattice", options.lattice,
                 "box of the grid: free (the reachable free space) or bounds (encloses the walls); "
                 "short for --option box=BOX")
      ->type_name("BOX")
      ->check(CLI::IsMember({"free", "bounds"}).description(""))
      ->default_str("free")
      ->group(group);
  app.add_option("--vertical", options.vertical,
                 "spacing of the grid along y over that along x and z, 0.25 to 8; above 1: fewer "
                 "probes vertically, more horizontally; short for --option vertical=F")
      ->type_name("F")
      ->check(checkPositive)
      ->default_str("1")
      ->group(group);
  for (const char* other : {"--strategy", "--probes", "--option", "--lattice", "--vertical"})
    layout->excludes(app.get_option(other));
}

void addParamsOptions(CLI::App& app, FieldOptions& options, const std::string& flag) {
  const char* group = "Parameters";
  app.add_option(flag, options.params,
                 fmt::format("a preset ({}) or a TOML file", fmt::join(presetNames(), ", ")))
      ->type_name("PRESET|FILE")
      ->capture_default_str()
      ->group(group);
  app.add_option(
         "--set", options.set,
         fmt::format("one parameter over {}; may be repeated; 'probelab info --params' lists all "
                     "with units, ranges and presets",
                     flag))
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false)
      ->group(group);
  app.add_option("--rays", options.rays, "rays a probe and update")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->default_str(options.rays ? std::to_string(*options.rays) : "as " + flag + " says")
      ->group(group);
}

void addTracingOptions(CLI::App& app, FieldOptions& options) {
  app.add_option("--tracer", options.tracer,
                 "rayquery (on the device), embree (on the host) or auto (rayquery on a GPU that "
                 "has it)")
      ->type_name("NAME")
      ->check(CLI::IsMember({"auto", "rayquery", "embree"}).description(""))
      ->capture_default_str()
      ->group("Field");
  app.add_option("--ray-proxy", options.ray_proxy_m,
                 "probe rays see simpler geometry that is off by at most this many metres, and by "
                 "no more than a quarter of the thinnest wall; 0: off")
      ->type_name("M")
      ->check(checkNotNegative)
      ->capture_default_str()
      ->group("Field");
}

void addFieldOptions(CLI::App& app, FieldOptions& options) {
  addPlacementOptions(app, options);
  addParamsOptions(app, options);
  const char* group = "Field";
  app.add_option("--mode", options.mode,
                 "converged (the average of many updates, for studies) or temporal (hysteresis, as "
                 "an engine runs it)")
      ->type_name("MODE")
      ->check(CLI::IsMember({"converged", "temporal"}).description(""))
      ->capture_default_str()
      ->group(group);
  app.add_option("--updates", options.updates,
                 fmt::format("updates: those averaged when converged (default: {}), all of them "
                             "when temporal (default: {})",
                             kDefaultAveraged, kDefaultTemporal))
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->group(group);
  addTracingOptions(app, options);
}

void addValuesOption(CLI::App& app, FieldOptions& options) {
  app.add_option("--values", options.values,
                 "texel values fitted to one light, as 'probelab tune --fit-values' writes, put on "
                 "the field after its last update; for the same probes")
      ->type_name("VALUES.json")
      ->check(checkNamed)
      ->group("Field");
}

std::vector<std::string> strategyOptionPairs(const FieldOptions& options) {
  std::vector<std::string> pairs = options.option;
  const Strategy& strategy = findStrategy(options.strategy);
  const auto add = [&](const char* flag, const std::string& name, const std::string& value) {
    const bool known =
        std::any_of(strategy.options.begin(), strategy.options.end(),
                    [&](const StrategyOption& option) { return option.name == name; });
    if (!known) throwInput("{}: strategy '{}' has no option '{}'", flag, strategy.name, name);
    pairs.push_back(name + "=" + value);
  };
  if (options.lattice) add("--lattice", "box", *options.lattice);
  if (options.vertical) add("--vertical", "vertical", fmt::format("{}", *options.vertical));
  return pairs;
}

Params resolveParams(const FieldOptions& options) {
  Params params = loadParams(options.params);
  if (options.rays) setParam(params, fmt::format("rays={}", *options.rays));
  for (const std::string& assignment : options.set) {
    setParam(params, assignment);
    if (options.rays && params.rays != *options.rays)
      throwInput("--rays {} and --set {} disagree; give one of them", *options.rays, assignment);
  }
  return params;
}

}  // namespace probelab
