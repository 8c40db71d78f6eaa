// SPDX-License-Identifier: Apache-2.0
#include "ddgi/params.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <toml++/toml.h>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <variant>

#include "base/error.h"
#include "base/files.h"
#include "base/parse_toml.h"
#include "base/suggest.h"
#include "ddgi/preset_files.h"
#include "param_keys.h"

namespace probelab {
namespace {

std::vector<std::string> keyNames() {
  std::vector<std::string> names;
  for (const ParamKey& key : paramKeys()) names.push_back(key.name);
  return names;
}

std::string rangeText(const ParamKey& key) {
  if (const auto* real = std::get_if<RealKey>(&key.kind))
    return fmt::format("{:g} .. {:g}", real->low, real->high);
  if (const auto* integer = std::get_if<IntKey>(&key.kind))
    return fmt::format("{} .. {}", integer->low, integer->high);
  if (const auto* choice = std::get_if<ChoiceKey>(&key.kind))
    return fmt::format("{}", fmt::join(choice->names, ", "));
  return "true, false";
}

// Sets one key from a TOML value; `where` opens every message.
void assign(Params& params, const ParamKey& key, const toml::node& value,
            const std::string& where) {
  const auto refuse = [&](const std::string& what) {
    throwInput("{}: {} {}; it takes {}", where, key.name, what, rangeText(key));
  };
  if (const auto* real = std::get_if<RealKey>(&key.kind)) {
    const auto v = value.value<double>();
    if (!v) refuse("is not a number");
    if (!(*v >= real->low && *v <= real->high)) refuse(fmt::format("is {:g}", *v));
    params.*(real->member) = *v;
  } else if (const auto* integer = std::get_if<IntKey>(&key.kind)) {
    const auto v = value.value_exact<int64_t>();
    if (!v) refuse("is not a whole number");
    if (*v < integer->low || *v > integer->high) refuse(fmt::format("is {}", *v));
    params.*(integer->member) = static_cast<int>(*v);
  } else if (const auto* flag = std::get_if<SwitchKey>(&key.kind)) {
    const auto v = value.value_exact<bool>();
    if (!v) refuse("is not true or false");
    params.*(flag->member) = *v ? 1 : 0;
  } else if (const auto* choice = std::get_if<ChoiceKey>(&key.kind)) {
    const auto v = value.value_exact<std::string>();
    if (!v) refuse("is not a name");
    const auto at = std::find(choice->names.begin(), choice->names.end(), *v);
    if (at == choice->names.end())
      throwInput("{}: {} is '{}'{}", where, key.name, *v, suggestion(*v, choice->names));
    params.*(choice->member) = static_cast<int>(at - choice->names.begin());
  }
}

const ParamKey& findKey(const std::string& name, const std::string& where) {
  for (const ParamKey& key : paramKeys())
    if (key.name == name) return key;
  throwInput("{}: unknown parameter '{}'{}", where, name, suggestion(name, keyNames()));
}

const EmbeddedFile* findPreset(const std::string& name) {
  for (const EmbeddedFile& preset : presetFiles())
    if (preset.name == name) return &preset;
  return nullptr;
}

// A line of TOML; an empty table where it is none.
toml::table parseValue(const std::string& line) {
  try {
    return parseTomlTwice(line, {});
  } catch (const toml::parse_error&) {
    return {};
  }
}

Params readParams(std::string_view text, const std::string& path, bool is_preset) {
  const toml::table table = parseToml(text, path);
  Params params;
  const toml::node* base = table.get("preset");
  if (base != nullptr) {
    const auto name = base->value_exact<std::string>();
    if (is_preset || !name || findPreset(*name) == nullptr)
      throwInput("{}:{}: preset must be one of {}", path, base->source().begin.line,
                 fmt::join(presetNames(), ", "));
    params = loadParams(*name);
  }
  std::vector<std::string> missing = keyNames();
  for (const auto& [name, node] : table) {
    if (name == "preset") continue;
    const std::string where = fmt::format("{}:{}", path, node.source().begin.line);
    const std::string key(name.str());
    assign(params, findKey(key, where), node, where);
    std::erase(missing, key);
  }
  if (base == nullptr && !missing.empty())
    throwInput("{}: no value for {}{}; set it, or add preset = \"rtxgi\" to start from a preset",
               path, missing.front(),
               missing.size() > 1 ? fmt::format(" and {} others", missing.size() - 1) : "");
  return params;
}

}  // namespace

std::vector<ParamInfo> paramTable() {
  std::vector<ParamInfo> table;
  for (const ParamKey& key : paramKeys())
    table.push_back({key.name, key.unit, rangeText(key), key.advice});
  return table;
}

std::vector<std::string> presetNames() {
  std::vector<std::string> names;
  for (const EmbeddedFile& preset : presetFiles()) names.push_back(preset.name);
  return names;
}

Params loadParams(const std::string& preset_or_file) {
  Params params;
  if (const EmbeddedFile* preset = findPreset(preset_or_file)) {
    params = readParams(preset->text, preset_or_file + ".toml", true);
    params.name = preset_or_file;
  } else {
    const std::filesystem::path path = preset_or_file;
    if (path.extension() != ".toml")
      throwInput("unknown preset '{}'{} (or name a .toml file)", preset_or_file,
                 suggestion(preset_or_file, presetNames()));
    params = readParams(readTextFile(path), path.string(), false);
    params.name = path.stem().string();
  }
  validateParams(params);
  return params;
}

void setParam(Params& params, const std::string& assignment) {
  const std::string where = fmt::format("--set {}", assignment);
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos) throwInput("{}: write it as key=value", where);
  const std::string name = assignment.substr(0, equals);
  const std::string value = assignment.substr(equals + 1);
  const ParamKey& key = findKey(name, where);
  const bool bare_name = std::holds_alternative<ChoiceKey>(key.kind) &&
                         value.find_first_of("\"'") == std::string::npos;
  const toml::table table =
      parseValue(bare_name ? fmt::format("v = \"{}\"", value) : "v = " + value);
  if (table.get("v") == nullptr || table.size() != 1)
    throwInput("{}: '{}' is not one value; {} takes {}", where, value, name, rangeText(key));
  assign(params, key, *table.get("v"), where);
  params.name += fmt::format(" {}={}", name, value);
  validateParams(params);
}

std::string describeParams(const Params& params) {
  std::ostringstream text;
  for (const ParamKey& key : paramKeys()) {
    std::string value;
    if (const auto* real = std::get_if<RealKey>(&key.kind)) {
      value = fmt::format("{}", params.*(real->member));
      if (value.find_first_of(".e") == std::string::npos) value += ".0";
    } else if (const auto* integer = std::get_if<IntKey>(&key.kind)) {
      value = fmt::format("{}", params.*(integer->member));
    } else if (const auto* flag = std::get_if<SwitchKey>(&key.kind)) {
      value = params.*(flag->member) != 0 ? "true" : "false";
    } else if (const auto* choice = std::get_if<ChoiceKey>(&key.kind)) {
      value = '"' + choice->names[static_cast<std::size_t>(params.*(choice->member))] + '"';
    }
    text << key.name << " = " << value << '\n';
  }
  return text.str();
}

void validateParams(const Params& params) {
  const AtlasSides sides = atlasSides(params);
  if (sides.irradiance < 1 || sides.moments < 1)
    throwInput("{}: an atlas needs at least {} texels a side{}", params.name, 1 + 2 * sides.border,
               sides.border ? ", border included" : "");
  if (params.visibility == 0 && params.fallback == PL_FALLBACK_LERP_UNOCCLUDED)
    throwInput("{}: fallback = \"lerp_unoccluded\" needs visibility = true", params.name);
  if (params.visibility == 0 && params.parallax > 0)
    throwInput("{}: parallax above 0 needs visibility = true (it reads distances)", params.name);
  if (params.irradiance_fit != 0 && params.encoding_gamma != 1.0)
    throwInput("{}: irradiance_fit = true needs encoding_gamma = 1 (it fits linear values)",
               params.name);
}

AtlasSides atlasSides(const Params& params) {
  const int border = params.border != 0 ? 1 : 0;
  return {params.irradiance_texels - 2 * border, params.moment_texels - 2 * border, border};
}

QueryModes queryModes(const Params& params) {
  return {params.facing,
          params.trilinear,
          params.visibility,
          params.crush,
          params.average,
          params.fallback,
          0,
          params.offset_weights,
          0,
          params.parallax > 0 ? 1 : 0};
}

QueryParams<double> queryParams(const Params& params) {
  QueryParams<double> query;
  query.normal_bias = params.normal_bias;
  query.view_bias = params.view_bias;
  query.facing_offset = params.facing_offset;
  query.trilinear_floor = params.trilinear_floor;
  query.chebyshev_power = params.chebyshev_power;
  query.visibility_floor = params.visibility_floor;
  query.variance_bias = params.variance_bias;
  // Half a unit in the last place of a stored raw moment: below it a variance is rounding alone.
  const bool fine = params.moment_format == PL_FORMAT_RG32F || params.moment_encoding != 0;
  query.variance_floor = fine ? 0x1p-24 : 0x1p-11;
  query.crush_threshold = params.crush_threshold;
  query.parallax = params.parallax;
  query.decode_exponent = params.encoding_gamma * (params.average == PL_AVERAGE_LINEAR ? 1.0 : 0.5);
  return query;
}

uint64_t atlasBytesPerProbe(const Params& params) {
  const auto side_i = static_cast<uint64_t>(params.irradiance_texels);
  const auto side_m = static_cast<uint64_t>(params.moment_texels);
  const uint64_t irradiance = side_i * side_i * irradianceWords(params.irradiance_format);
  const uint64_t moments =
      params.visibility != 0 ? side_m * side_m * momentWords(params.moment_format) : 0;
  return 4 * (irradiance + moments);
}

}  // namespace probelab
