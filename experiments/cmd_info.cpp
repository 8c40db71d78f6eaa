// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab info`: what this machine and this build can do.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/build_info.h"
#include "base/error.h"
#include "base/parallel.h"
#include "commands.h"
#include "field_setup.h"
#include "gpu/context.h"
#include "json.h"
#include "program.h"
#include "require.h"
#include "table.h"
#include "trace/embree_scene.h"

namespace probelab {
namespace {

struct DeviceChoice {
  std::optional<std::size_t> index;
  std::string problem;  // why there is none
};

DeviceChoice choose(const std::vector<DeviceInfo>& devices, const std::string& wanted) {
  try {
    return {chooseDevice(devices, wanted), ""};
  } catch (const DeviceError& error) {
    return {std::nullopt, error.what()};
  }
}

Json describeDevice(const DeviceInfo& device, std::size_t index, bool chosen) {
  return {{"index", index},
          {"name", device.name},
          {"driver", device.driver},
          {"vulkan", device.api_version},
          {"type", device.type},
          {"chosen", chosen},
          {"suitable", device.missing.empty()},
          {"missing", device.missing},
          {"ray_query", device.ray_query},
          {"device_local_bytes", device.device_local_bytes},
          {"max_storage_buffer_range", device.max_storage_buffer_range},
          {"max_buffer_size", device.max_buffer_size},
          {"max_workgroup_invocations", device.max_workgroup_invocations},
          {"max_shared_memory_bytes", device.max_shared_memory_bytes},
          {"subgroup_size", device.subgroup_size},
          {"timestamp_valid_bits", device.timestamp_valid_bits},
          {"timestamp_period_ns", device.timestamp_period_ns}};
}

std::string fmtVersion() {
  return fmt::format("{}.{}.{}", FMT_VERSION / 10000, FMT_VERSION / 100 % 100, FMT_VERSION % 100);
}

Json describe(const std::vector<DeviceInfo>& devices, const DeviceChoice& choice) {
  const BuildInfo build = buildInfo();
  Json json = {
      {"version", build.version},
      {"compiler", build.compiler},
      {"build_type", build.build_type},
      {"threads", threadCount()},
      {"libraries",
       {{"embree", embreeVersion()},
        {"fmt", fmtVersion()},
        {"nlohmann_json", fmt::format("{}.{}.{}", NLOHMANN_JSON_VERSION_MAJOR,
                                      NLOHMANN_JSON_VERSION_MINOR, NLOHMANN_JSON_VERSION_PATCH)},
        {"cli11", CLI11_VERSION}}},
      {"tracers", Json::array({"embree"})},
      {"devices", Json::array()}};
  for (std::size_t i = 0; i < devices.size(); ++i)
    json["devices"].push_back(describeDevice(devices[i], i, choice.index == i));
  if (choice.index && devices[*choice.index].ray_query) json["tracers"].push_back("rayquery");
  return json;
}

std::string joinWords(const Json& list) {
  return fmt::format("{}", fmt::join(list.get<std::vector<std::string>>(), ", "));
}

void printInfo(const Json& json) {
  std::vector<std::string> libraries;
  for (const auto& [name, version] : json["libraries"].items())
    libraries.push_back(name + " " + version.get<std::string>());
  fmt::print("{}", formatFields({{"probelab", json["version"].get<std::string>()},
                                 {"compiler", json["compiler"].get<std::string>() + ", " +
                                                  json["build_type"].get<std::string>()},
                                 {"libraries", fmt::format("{}", fmt::join(libraries, ", "))},
                                 {"threads", json["threads"].dump()},
                                 {"tracers", joinWords(json["tracers"])}}));
  for (const Json& d : json["devices"]) {
    const auto bytes = [&](const char* name) { return formatBytes(d[name].get<double>()); };
    fmt::print("\nDevice {}{}\n", d["index"].get<int>(),
               d["chosen"].get<bool>() ? " (the one that commands use)" : "");
    fmt::print(
        "{}",
        formatFields({{"  name", d["name"].get<std::string>()},
                      {"  type", d["type"].get<std::string>()},
                      {"  driver", d["driver"].get<std::string>()},
                      {"  Vulkan", d["vulkan"].get<std::string>()},
                      {"  ray query", d["ray_query"].get<bool>() ? "yes" : "no"},
                      {"  memory", bytes("device_local_bytes") + ", storage buffers up to " +
                                       bytes("max_storage_buffer_range")},
                      {"  workgroup", d["max_workgroup_invocations"].dump() + " invocations, " +
                                          bytes("max_shared_memory_bytes") +
                                          " shared, subgroups of " + d["subgroup_size"].dump()},
                      {"  missing", d["missing"].empty() ? "nothing" : joinWords(d["missing"])}}));
  }
}

std::string valueText(const Json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

// {"params": [{key, unit, range, advice, presets {name: value}}]}.
Json describeParameters() {
  std::vector<std::pair<std::string, Json>> presets;
  for (const std::string& name : presetNames())
    presets.emplace_back(name, toJson(loadParams(name)));
  Json params = Json::array();
  for (const ParamInfo& info : paramTable()) {
    Json values = Json::object();
    for (const auto& [name, values_of] : presets) values[name] = values_of[info.key];
    params.push_back({{"key", info.key},
                      {"unit", info.unit},
                      {"range", info.range},
                      {"advice", info.advice},
                      {"presets", values}});
  }
  return {{"params", params}};
}

void printParameters(const Json& json) {
  std::vector<std::string> header = {"parameter"};
  for (const std::string& name : presetNames()) header.push_back(name);
  TextTable table(header);
  for (const Json& p : json["params"]) {
    std::vector<std::string> row = {p["key"].get<std::string>()};
    for (const auto& [name, value] : p["presets"].items()) row.push_back(valueText(value));
    table.addRow(row);
  }
  fmt::print("Presets (--params NAME)\n{}\nParameters (--set KEY=VALUE)\n", table.text());
  for (const Json& p : json["params"]) {
    const std::string unit = p["unit"].get<std::string>();
    fmt::print("{}{}: {}\n    {}\n", p["key"].get<std::string>(),
               unit.empty() ? "" : fmt::format(" [{}]", unit), p["range"].get<std::string>(),
               p["advice"].get<std::string>());
  }
}

void runInfo(bool params, const Invocation& invocation) {
  if (params) {
    const Json json = describeParameters();
    return reportResult(invocation, json, [&] { printParameters(json); });
  }
  const std::vector<DeviceInfo> devices = listDevices();
  const DeviceChoice choice = choose(devices, invocation.common.device);
  const Json json = describe(devices, choice);
  reportResult(invocation, json, [&] { printInfo(json); });
  if (!choice.index) throw DeviceError(choice.problem);
}

}  // namespace

void addInfoCommand(Program& program) {
  auto params = std::make_shared<bool>(false);
  CLI::App& app =
      program.addCommand("info", "devices, their features, tracers and versions; all parameters",
                         "probelab info --params",
                         [params](const Invocation& invocation) { runInfo(*params, invocation); });
  app.add_flag("--params", *params,
               "instead: every parameter of a field with unit, range, when to change it, and its "
               "value in each preset")
      ->group("Output");
}

}  // namespace probelab
