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
#include "base/suggest.h"
#include "ddgi/preset_files.h"

namespace probelab {
namespace {

struct RealKey {
  double Params::*member;
  double low, high;
};
struct IntKey {
  int Params::*member;
  int low, high;
};
struct SwitchKey {
  int Params::*member;
};
struct ChoiceKey {  // the member holds the index of the name
  int Params::*member;
  std::vector<std::string> names;
};

struct Key {
  std::string name, unit;
  std::variant<RealKey, IntKey, SwitchKey, ChoiceKey> kind;
  std::string advice;
};

const std::vector<Key>& keys() {
  static const std::vector<Key> table = {
      {"rays", "", IntKey{&Params::rays, 1, 65536}, "more: less noise an update, more cost"},
      {"hysteresis", "", RealKey{&Params::hysteresis, 0, 1},
       "temporal mode: share of the old value an update keeps; higher: calmer, slower"},
      {"irradiance_texels", "texels", IntKey{&Params::irradiance_texels, 3, 66},
       "a side with the border; more: sharper in angle"},
      {"irradiance_format", "",
       ChoiceKey{&Params::irradiance_format, {"rgba32f", "rgba16f", "r11g11b10f", "rgb10a2"}},
       "rgba32f to rule out storage errors"},
      {"encoding_gamma", "", RealKey{&Params::encoding_gamma, 1, 8},
       "stored = mean^(1/gamma); 1 averages energy, 5 favours dark over bright"},
      {"moment_texels", "texels", IntKey{&Params::moment_texels, 3, 66},
       "a side with the border; more: sharper occlusion edges"},
      {"moment_format", "", ChoiceKey{&Params::moment_format, {"rg32f", "rg16f"}},
       "rg32f to rule out storage errors"},
      {"distance_exponent", "", RealKey{&Params::distance_exponent, 1, 1000},
       "sharpness of the lobe that distances are averaged over"},
      {"distance_clamp", "x r_i", RealKey{&Params::distance_clamp, 0.5, 100},
       "farther hits count as this far"},
      {"backface_shortening", "", RealKey{&Params::backface_shortening, 0, 1},
       "factor on the distance of a back face; small: probes in walls are occluded everywhere"},
      {"backface_skip", "", SwitchKey{&Params::backface_skip},
       "leave rays that hit back faces out of the irradiance"},
      {"visibility", "", SwitchKey{&Params::visibility}, "weigh probes by their distance moments"},
      {"normal_bias", "x s_i", RealKey{&Params::normal_bias, 0, 2},
       "higher against self-shadowing, lower against leaks through thin walls"},
      {"view_bias", "x s_i", RealKey{&Params::view_bias, 0, 2}, "the same, towards the viewer"},
      {"facing", "", ChoiceKey{&Params::facing, {"none", "wrap", "wrap_biased"}},
       "favour probes in front of the surface"},
      {"facing_offset", "", RealKey{&Params::facing_offset, 0, 10},
       "weight that a probe behind the surface keeps"},
      {"trilinear", "", ChoiceKey{&Params::trilinear, {"plain", "product_plus", "axis_max"}},
       "how the floor enters the trilinear weight"},
      {"trilinear_floor", "", RealKey{&Params::trilinear_floor, 0, 1},
       "keeps far corners of the cell in play when near ones are occluded"},
      {"chebyshev_power", "", RealKey{&Params::chebyshev_power, 0.1, 32},
       "higher: harder occlusion"},
      {"visibility_floor", "", RealKey{&Params::visibility_floor, 0, 1},
       "weight of a fully occluded probe; 0 against leaks, above 0 against black cells"},
      {"variance_bias", "x r_i^2", RealKey{&Params::variance_bias, 0, 1},
       "softens occlusion where distances are uniform"},
      {"crush", "", ChoiceKey{&Params::crush, {"none", "after_trilinear", "before_trilinear"}},
       "where small weights are pressed towards 0"},
      {"crush_threshold", "", RealKey{&Params::crush_threshold, 1e-6, 10},
       "weights below it become w^3 / threshold^2"},
      {"average", "", ChoiceKey{&Params::average, {"linear", "sqrt", "sqrt_of_weighted"}},
       "the space in which probes are averaged"},
      {"fallback", "", ChoiceKey{&Params::fallback, {"none", "lerp_unoccluded"}},
       "what a cell of occluded probes answers"},
  };
  return table;
}

std::vector<std::string> keyNames() {
  std::vector<std::string> names;
  for (const Key& key : keys()) names.push_back(key.name);
  return names;
}

std::string rangeText(const Key& key) {
  if (const auto* real = std::get_if<RealKey>(&key.kind))
    return fmt::format("{:g} .. {:g}", real->low, real->high);
  if (const auto* integer = std::get_if<IntKey>(&key.kind))
    return fmt::format("{} .. {}", integer->low, integer->high);
  if (const auto* choice = std::get_if<ChoiceKey>(&key.kind))
    return fmt::format("{}", fmt::join(choice->names, ", "));
  return "true, false";
}

// Sets one key from a TOML value; `where` opens every message.
void assign(Params& params, const Key& key, const toml::node& value, const std::string& where) {
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

const Key& findKey(const std::string& name, const std::string& where) {
  for (const Key& key : keys())
    if (key.name == name) return key;
  throwInput("{}: unknown parameter '{}'{}", where, name, suggestion(name, keyNames()));
}

const PresetFile* findPreset(const std::string& name) {
  for (const PresetFile& preset : presetFiles())
    if (preset.name == name) return &preset;
  return nullptr;
}

toml::table parseToml(std::string_view text, const std::string& path) {
  try {
    return toml::parse(text, path);
  } catch (const toml::parse_error& e) {
    throwInput("{}:{}: {}", path, e.source().begin.line, e.description());
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
    throwInput("{}: no value for {}; set it, or add preset = \"rtxgi\" to start from a preset",
               path, fmt::join(missing, ", "));
  return params;
}

}  // namespace

std::vector<ParamInfo> paramTable() {
  std::vector<ParamInfo> table;
  for (const Key& key : keys()) table.push_back({key.name, key.unit, rangeText(key), key.advice});
  return table;
}

std::vector<std::string> presetNames() {
  std::vector<std::string> names;
  for (const PresetFile& preset : presetFiles()) names.push_back(preset.name);
  return names;
}

Params loadParams(const std::string& preset_or_file) {
  Params params;
  if (const PresetFile* preset = findPreset(preset_or_file)) {
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
  const Key& key = findKey(name, where);
  const bool bare_name =
      std::holds_alternative<ChoiceKey>(key.kind) && value.find('"') == std::string::npos;
  const toml::table table =
      parseToml(bare_name ? fmt::format("v = \"{}\"", value) : "v = " + value, where);
  if (table.get("v") == nullptr || table.size() != 1) throwInput("{}: one value is needed", where);
  assign(params, key, *table.get("v"), where);
  params.name += fmt::format(" {}={}", name, value);
  validateParams(params);
}

std::string describeParams(const Params& params) {
  std::ostringstream text;
  for (const Key& key : keys()) {
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
  if (params.irradiance_texels < 3 || params.moment_texels < 3)
    throwInput("{}: an atlas needs at least 3 texels a side, border included", params.name);
  if (params.visibility == 0 && params.fallback == PL_FALLBACK_LERP_UNOCCLUDED)
    throwInput("{}: fallback = \"lerp_unoccluded\" needs visibility = true", params.name);
}

QueryModes queryModes(const Params& params) {
  return {params.facing, params.trilinear, params.visibility,
          params.crush,  params.average,   params.fallback};
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
  // Half a unit in the last place of a stored moment: below it a variance is rounding alone.
  query.variance_floor = params.moment_format == PL_FORMAT_RG32F ? 0x1p-24 : 0x1p-11;
  query.crush_threshold = params.crush_threshold;
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
