// SPDX-License-Identifier: GPL-3.0-or-later
#include "field_options.h"

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "common_options.h"

namespace probelab {
namespace {

void addLayoutOptions(CLI::App& app, FieldOptions& options) {
  const char* group = "Probes";
  CLI::Option* layout = app.add_option("--layout", options.layout,
                                       "probe positions from a layout file, instead of a strategy")
                            ->type_name("FILE")
                            ->group(group);
  app.add_option("--strategy", options.strategy, "how probes are placed: grid")
      ->type_name("NAME")
      ->capture_default_str()
      ->group(group)
      ->excludes(layout);
  app.add_option("--probes", options.probes, "at most this many probes that own texels")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str()
      ->group(group)
      ->excludes(layout);
  app.add_option("--lattice", options.lattice,
                 "box of the grid: free (the reachable free space) or bounds (encloses the walls)")
      ->type_name("BOX")
      ->check(CLI::IsMember({"free", "bounds"}).description(""))
      ->capture_default_str()
      ->group(group)
      ->excludes(layout);
}

}  // namespace

void addFieldOptions(CLI::App& app, FieldOptions& options) {
  addLayoutOptions(app, options);
  const char* group = "Field";
  app.add_option("--params", options.params,
                 "parameters: a preset (gdc2019, rtxgi, classic) or a TOML file")
      ->type_name("PRESET|FILE")
      ->capture_default_str()
      ->group(group);
  app.add_option("--set", options.set, "one parameter over --params; may be repeated")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false)
      ->group(group)
      ->check([](const std::string& text) {
        splitSetting(text);
        return std::string();
      });
  app.add_option("--rays", options.rays, "rays a probe and update (default: as --params says)")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->group(group);
  app.add_option("--mode", options.mode,
                 "converged (the average of many updates, for studies) or temporal (hysteresis, as "
                 "an engine runs it)")
      ->type_name("MODE")
      ->check(CLI::IsMember({"converged", "temporal"}).description(""))
      ->capture_default_str()
      ->group(group);
  app.add_option("--updates", options.updates,
                 "updates: averaged ones when converged, all of them when temporal (default: until "
                 "settled)")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->group(group);
  app.add_option("--tracer", options.tracer,
                 "rayquery (on the device), embree (on the host) or auto (rayquery on a GPU that "
                 "has it)")
      ->type_name("NAME")
      ->check(CLI::IsMember({"auto", "rayquery", "embree"}).description(""))
      ->capture_default_str()
      ->group(group);
}

std::pair<std::string, std::string> splitSetting(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
    throwInput("--set '{}': write KEY=VALUE, as in 'rays=256'", text);
  return {text.substr(0, equals), text.substr(equals + 1)};
}

}  // namespace probelab
