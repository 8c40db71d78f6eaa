// SPDX-License-Identifier: GPL-3.0-or-later
// The options of the commands that run a probe field (render, evaluate): which layout, which
// parameters, how it is run and traced.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ddgi/params.h"

namespace CLI {
class App;
}

namespace probelab {

inline constexpr int kDefaultAveraged = 64;   // --updates when converged
inline constexpr int kDefaultTemporal = 256;  // --updates when temporal

struct FieldOptions {
  std::string layout;  // a layout file; empty: made by the strategy
  std::string strategy = "grid";
  int probes = 512;                    // at most that many own texels
  std::vector<std::string> option;     // key=value, of the strategy
  std::optional<std::string> lattice;  // the grid's option box: free | bounds
  std::optional<double> vertical;      // its option vertical: spacing along y over x and z
  std::string params = "rtxgi";        // a preset's name or a TOML file
  std::vector<std::string> set;        // key=value, over `params`
  std::optional<int> rays;             // a probe and update; empty: as `params` says
  std::string mode = "converged";      // converged | temporal
  std::optional<int> updates;          // temporal: how many; converged: how many are averaged
  std::string tracer = "auto";         // auto | rayquery | embree
  std::string values;                  // fitted texel values; empty: as traced
  double ray_proxy_m = 0;  // error that probe rays' geometry may have; 0: the scene itself
};

// All of them, or a part: --layout; --strategy, --probes, --option; --lattice, --vertical;
// --params,
// --set, --rays; --tracer, --ray-proxy.
void addFieldOptions(CLI::App& app, FieldOptions& options);
void addPlacementOptions(CLI::App& app, FieldOptions& options);
void addStrategyOptions(CLI::App& app, FieldOptions& options);  // without --layout
// `flag` names the parameters that --set and --rays change.
void addParamsOptions(CLI::App& app, FieldOptions& options, const std::string& flag = "--params");
void addTracingOptions(CLI::App& app, FieldOptions& options);

// --values: runField puts them on the field.
void addValuesOption(CLI::App& app, FieldOptions& options);

// Every --option, and --lattice and --vertical as the options that they stand for.
std::vector<std::string> strategyOptionPairs(const FieldOptions& options);

// --params with --rays and then every --set over it. Throws InputError.
Params resolveParams(const FieldOptions& options);

}  // namespace probelab
