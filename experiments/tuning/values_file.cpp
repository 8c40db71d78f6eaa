// SPDX-License-Identifier: GPL-3.0-or-later
#include "tuning/values_file.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "base/build_info.h"
#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "base/suggest.h"
#include "shared/octahedral.h"
#include "texel_rows.h"

namespace probelab {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "probelab values 1";
constexpr std::size_t kDigits = 8;  // of a gain, the bits of an fp32 number
constexpr int kMostTexels = 64;     // a side
constexpr uint64_t kMostProbes = 1u << 24;

template <class T>
void addBytes(std::string& bytes, std::span<const T> values) {
  static_assert(std::is_trivially_copyable_v<T>);
  bytes += std::to_string(values.size()) + ":";
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
}
template <class T>
void addBytes(std::string& bytes, const std::vector<T>& values) {
  addBytes(bytes, std::span<const T>(values));
}

void addLattice(std::string& bytes, const Lattice& lattice) {
  addBytes(bytes, std::span<const Vec3f>(&lattice.first, 1));
  addBytes(bytes, std::span<const Vec3f>(&lattice.spacing, 1));
  addBytes(bytes, std::span<const Vec3i>(&lattice.count, 1));
}

// Gains of one probe as hexadecimal bits, or nothing where all are 1.
std::string gainText(std::span<const Vec3f> gains) {
  if (std::all_of(gains.begin(), gains.end(), [](const Vec3f& g) { return g == Vec3f(1); }))
    return "";
  constexpr const char* kHex = "0123456789abcdef";
  std::string text;
  for (const Vec3f& gain : gains)
    for (std::size_t c = 0; c < 3; ++c)
      for (int shift = 28; shift >= 0; shift -= 4)
        text.push_back(kHex[(std::bit_cast<uint32_t>(gain[c]) >> shift) & 15]);
  return text;
}

float gainOf(std::string_view digits, const std::string& where) {
  uint32_t bits = 0;
  const auto [end, ec] = std::from_chars(digits.data(), digits.data() + digits.size(), bits, 16);
  if (ec != std::errc() || end != digits.data() + digits.size())
    throwInput("{}: '{}' is not 8 hexadecimal digits", where, digits);
  const float gain = std::bit_cast<float>(bits);
  if (!std::isfinite(gain) || std::signbit(gain))
    throwInput("{}: a gain must be finite and not negative", where);
  return gain;
}

// Throws InputError for what is no JSON object, names a member twice or one that is unknown.
Json parseValues(const std::string& text, const std::string& file) {
  static const std::vector<std::string> kKnown = {
      "format", "program", "scene", "state", "params", "probes_hash", "texels", "probes", "gains"};
  std::set<std::string> seen;
  std::string twice;
  const Json json = Json::parse(
      text,
      [&](int, Json::parse_event_t event, Json& parsed) {
        if (event == Json::parse_event_t::key && !seen.insert(parsed.get<std::string>()).second)
          twice = parsed.get<std::string>();
        return true;
      },
      false);
  if (json.is_discarded() || !json.is_object())
    throwInput("{}: not a JSON object; 'probelab tune --fit-values' writes such files", file);
  if (!twice.empty()) throwInput("{}: key '{}' stands twice", file, twice);
  for (const auto& item : json.items())
    if (std::find(kKnown.begin(), kKnown.end(), item.key()) == kKnown.end())
      throwInput("{}: unknown key '{}'{}", file, item.key(), suggestion(item.key(), kKnown));
  return json;
}

std::string textOf(const Json& json, const char* name, const std::string& file) {
  if (!json.contains(name)) throwInput("{}: '{}' is missing", file, name);
  if (!json[name].is_string()) throwInput("{}: '{}' must be a string", file, name);
  return json[name].get<std::string>();
}

uint64_t countOf(const Json& json, const char* name, uint64_t most, const std::string& file) {
  if (!json.contains(name)) throwInput("{}: '{}' is missing", file, name);
  const Json& value = json[name];
  if (!value.is_number_unsigned() || value.get<uint64_t>() < 1 || value.get<uint64_t>() > most)
    throwInput("{}: '{}' must be a whole number from 1 to {}", file, name, most);
  return value.get<uint64_t>();
}

}  // namespace

std::string probesHash(const ProbeLayout& layout, const ProbeStates& states, const Params& params) {
  std::string bytes = std::string(interpolantName(layout.interpolant)) + " " +
                      std::to_string(atlasSides(params).irradiance) + " ";
  addLattice(bytes, layout.lattice);
  addBytes(bytes, layout.probe_of_point);
  addBytes(bytes, states.positions);
  addBytes(bytes, states.active);
  addLattice(bytes, layout.influence.corners);
  addBytes(bytes, layout.influence.pieces.plane_of_voxel);
  addBytes(bytes, layout.influence.pieces.planes);
  addBytes(bytes, layout.influence.voxel_begin);
  addBytes(bytes, layout.influence.entries);
  return contentHash(bytes);
}

TexelValues makeValues(const ProbeField& field, const Receivers& receivers,
                       std::span<const Vec3f> traced, std::span<const Vec3f> fitted) {
  const AtlasSides sides = atlasSides(field.params());
  const auto tile = static_cast<std::size_t>(sides.stored(sides.irradiance)) *
                    static_cast<std::size_t>(sides.stored(sides.irradiance));
  PROBELAB_CHECK_EQ(traced.size(), field.probeCount() * tile);
  PROBELAB_CHECK_EQ(fitted.size(), traced.size());
  TexelValues values{.scene = receivers.scene_path,
                     .state = receivers.state,
                     .params = field.params().name,
                     .probes_hash = probesHash(field.layout(), field.states(), field.params()),
                     .texels = sides.irradiance,
                     .gains = {}};
  const int n = sides.irradiance;
  const double gamma = field.params().encoding_gamma;
  for (std::size_t p = 0; p < field.probeCount(); ++p)
    for (int k = 0; k < n * n; ++k) {
      const std::size_t i =
          p * tile + static_cast<std::size_t>(tileTexel(k % n, k / n, n, sides.border));
      Vec3f gain(1);
      for (std::size_t c = 0; c < 3; ++c) {
        const double before = static_cast<double>(traced[i][c]);
        if (before > 0)
          gain[c] = static_cast<float>(std::pow(static_cast<double>(fitted[i][c]) / before, gamma));
      }
      values.gains.push_back(gain);
    }
  return values;
}

void writeValues(const std::filesystem::path& path, const TexelValues& values) {
  const auto per_probe = static_cast<std::size_t>(values.texels * values.texels);
  Json gains = Json::array();
  for (std::size_t i = 0; i < values.gains.size(); i += per_probe)
    gains.push_back(gainText(std::span(values.gains).subspan(i, per_probe)));
  const Json json = {{"format", kFormat},        {"program", buildInfo().version},
                     {"scene", values.scene},    {"state", values.state},
                     {"params", values.params},  {"probes_hash", values.probes_hash},
                     {"texels", values.texels},  {"probes", gains.size()},
                     {"gains", std::move(gains)}};
  writeTextFile(path, json.dump(1) + "\n");
}

TexelValues readValues(const std::filesystem::path& path) {
  const std::string file = path.string();
  const Json json = parseValues(readTextFile(path), file);
  if (textOf(json, "format", file) != kFormat)
    throwInput("{}: 'format' must be \"{}\"; 'probelab tune --fit-values' writes such files", file,
               kFormat);
  TexelValues values{.scene = textOf(json, "scene", file),
                     .state = textOf(json, "state", file),
                     .params = textOf(json, "params", file),
                     .probes_hash = textOf(json, "probes_hash", file),
                     .texels = static_cast<int>(countOf(json, "texels", kMostTexels, file)),
                     .gains = {}};
  const uint64_t probes = countOf(json, "probes", kMostProbes, file);
  if (!json.contains("gains") || !json["gains"].is_array() || json["gains"].size() != probes)
    throwInput("{}: 'gains' must be a list of {} strings, one a probe", file, probes);
  const auto texels = static_cast<std::size_t>(values.texels * values.texels);
  for (std::size_t p = 0; p < probes; ++p) {
    const std::string where = fmt::format("{}: 'gains'[{}]", file, p);
    const Json& item = json["gains"][p];
    if (!item.is_string()) throwInput("{} must be a string", where);
    const auto& text = item.get_ref<const std::string&>();
    if (!text.empty() && text.size() != 3 * kDigits * texels)
      throwInput("{} must be empty or have {} digits, 8 a channel of its {} x {} texels", where,
                 3 * kDigits * texels, values.texels, values.texels);
    for (std::size_t k = 0; k < texels; ++k) {
      Vec3f gain(1);
      for (std::size_t c = 0; c < 3 && !text.empty(); ++c)
        gain[c] = gainOf(std::string_view(text).substr((3 * k + c) * kDigits, kDigits), where);
      values.gains.push_back(gain);
    }
  }
  return values;
}

void checkValues(const TexelValues& values, const ProbeField& field, const std::string& file) {
  const int n = atlasSides(field.params()).irradiance;
  const auto texels = static_cast<std::size_t>(values.texels * values.texels);
  if (values.texels != n)
    throwInput("{}: is for {} x {} irradiance texels a probe, and the parameters have {} x {}",
               file, values.texels, values.texels, n, n);
  if (values.gains.size() != field.probeCount() * texels)
    throwInput("{}: is for {} probes, and the layout has {}", file, values.gains.size() / texels,
               field.probeCount());
  if (values.probes_hash != probesHash(field.layout(), field.states(), field.params()))
    throwInput(
        "{}: was fitted to other probes than these; take the scene, the layout (or the options "
        "and the seed that made it), relocation and classification of the fit, {}",
        file, values.scene);
}

std::vector<Vec3f> texelsWithGains(const TexelValues& values, const Params& params,
                                   std::vector<Vec3f> stored) {
  const AtlasSides sides = atlasSides(params);
  const std::vector<int> interior = interiorTexels(sides.irradiance, sides.border);
  const auto texels = static_cast<std::size_t>(values.texels * values.texels);
  PROBELAB_CHECK_EQ(stored.size() / interior.size(), values.gains.size() / texels);
  const double exponent = 1 / params.encoding_gamma;
  for (std::size_t i = 0; i < stored.size(); ++i) {
    const Vec3f& gain = values.gains[i / interior.size() * texels +
                                     static_cast<std::size_t>(interior[i % interior.size()])];
    for (std::size_t c = 0; c < 3; ++c)
      stored[i][c] = static_cast<float>(static_cast<double>(stored[i][c]) *
                                        std::pow(static_cast<double>(gain[c]), exponent));
  }
  return stored;
}

void applyValues(ProbeField& field, const TexelValues& values) {
  field.setIrradianceTexels(texelsWithGains(values, field.params(), field.irradianceTexels()));
}

}  // namespace probelab
