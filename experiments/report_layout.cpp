// SPDX-License-Identifier: GPL-3.0-or-later
#include "report_layout.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>

#include "base/error.h"
#include "base/files.h"
#include "image/tonemap.h"
#include "placement/free_space.h"
#include "placement/nearest_probes.h"
#ifdef PROBELAB_WITH_CGAL
#include "placement/distance.h"
#endif

namespace probelab {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

std::vector<std::byte> floatBytes(const std::vector<float>& values) {
  std::vector<std::byte> bytes;
  bytes.reserve(values.size() * 4);
  for (const float value : values) {
    const auto bits = std::bit_cast<uint32_t>(value);
    for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<std::byte>(bits >> (8 * i) & 0xff));
  }
  return bytes;
}

std::vector<std::byte> byteBytes(const std::vector<uint8_t>& values) {
  std::vector<std::byte> bytes(values.size());
  std::ranges::transform(values, bytes.begin(), [](uint8_t v) { return std::byte{v}; });
  return bytes;
}

Json vectorJson(const Vec3d& v) { return {v.x, v.y, v.z}; }

float srgbToLinear(float v) {
  return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f);
}

Vec3f meanColor(const Texture& texture) {
  Vec3d sum;
  for (std::size_t i = 0; i + 3 < texture.rgba.size(); i += 4)
    for (std::size_t c = 0; c < 3; ++c)
      sum[c] += static_cast<double>(srgbToLinear(static_cast<float>(texture.rgba[i + c]) / 255.0f));
  return Vec3f(sum / std::max(1.0, static_cast<double>(texture.rgba.size() / 4)));
}

// A material as the view shows it, sRGB: its mean albedo, or the hue of what it emits.
std::vector<Vec3<uint8_t>> materialColors(const Scene& scene) {
  std::vector<Vec3f> textures;
  for (const Texture& texture : scene.textures) textures.push_back(meanColor(texture));
  std::vector<Vec3<uint8_t>> colors;
  for (const Material& material : scene.materials) {
    Vec3f color = material.base_color * (1 - material.metallic);
    if (material.base_color_texture.used())
      color = color * textures[static_cast<std::size_t>(material.base_color_texture.texture)];
    if (const float most = maxComponent(material.emission); most > 0)
      color = material.emission / most;
    colors.emplace_back(linearToSrgbByte(color.x), linearToSrgbByte(color.y),
                        linearToSrgbByte(color.z));
  }
  return colors;
}

float areaOf(const Geometry& geometry, const Triangle& triangle) {
  const Vec3f a = geometry.positions[triangle.vertex[0]];
  return length(cross(geometry.positions[triangle.vertex[1]] - a,
                      geometry.positions[triangle.vertex[2]] - a)) /
         2;
}

// The triangles that are shown, in their own order but with those of one-sided materials first.
std::vector<uint32_t> shownTriangles(const Scene& scene, std::size_t& one_sided) {
  const Geometry& geometry = *scene.geometry;
  std::vector<uint32_t> shown(geometry.triangles.size());
  std::iota(shown.begin(), shown.end(), 0u);
  if (shown.size() > kMostTriangles) {
    std::ranges::stable_sort(shown, std::greater<>(),
                             [&](uint32_t t) { return areaOf(geometry, geometry.triangles[t]); });
    shown.resize(kMostTriangles);
    std::ranges::sort(shown);
  }
  const auto middle = std::stable_partition(shown.begin(), shown.end(), [&](uint32_t t) {
    return !scene.materials[geometry.triangles[t].material].double_sided;
  });
  one_sided = static_cast<std::size_t>(middle - shown.begin());
  return shown;
}

Json trianglesJson(const Scene& scene, ReportPage& page) {
  const Geometry& geometry = *scene.geometry;
  const std::vector<Vec3<uint8_t>> materials = materialColors(scene);
  std::size_t one_sided = 0;
  const std::vector<uint32_t> shown = shownTriangles(scene, one_sided);
  std::vector<float> positions;
  std::vector<uint8_t> colors;
  for (const uint32_t t : shown) {
    const Triangle& triangle = geometry.triangles[t];
    for (const uint32_t vertex : triangle.vertex)
      for (std::size_t c = 0; c < 3; ++c) positions.push_back(geometry.positions[vertex][c]);
    for (std::size_t c = 0; c < 3; ++c) colors.push_back(materials[triangle.material][c]);
  }
  return {{"shown", shown.size()},
          {"all", geometry.triangles.size()},
          {"one_sided", one_sided},
          {"positions", page.addBlob(floatBytes(positions), "triangles of " + scene.path)},
          {"colors", page.addBlob(byteBytes(colors), "colours of " + scene.path)}};
}

// 0 active, 1 off, 2 inside.
std::vector<uint8_t> probeStates(const ReportLayoutInput& input) {
  std::vector<uint8_t> states(input.states.positions.size(), 0);
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (input.states.active[i] == 0) states[i] = 1;
    if (isInsideSolid(input.scene, input.embree, input.states.positions[i])) states[i] = 2;
  }
  return states;
}

struct ProbeValues {
  std::string name, unit, about;
  std::vector<float> values;
};

// What is known of every probe of any layout.
std::vector<ProbeValues> layoutValues(const ReportLayoutInput& input) {
  const ProbeLayout& layout = input.layout;
  const std::size_t count = layout.positions.size();
  std::vector<ProbeValues> all = {
      {"spacing", "m", "distance to the nearest other probe", std::vector<float>(count, kNone)},
      {"bias length", "m", "s_i, the unit of biases", std::vector<float>(count)},
      {"support radius", "m", "r_i, where the probe's weight ends", std::vector<float>(count)}};
  const NearestProbes probes(input.states.positions);
  std::vector<NearProbe> near;
  for (std::size_t i = 0; i < count; ++i) {
    probes.nearest(input.states.positions[i], 2, near);
    if (near.size() > 1) all[0].values[i] = near.back().distance_m;
    all[1].values[i] = probeLengths(layout, i).bias;
    all[2].values[i] = probeLengths(layout, i).support;
  }
#ifdef PROBELAB_WITH_CGAL
  if (!input.scene.geometry->triangles.empty()) {
    const SceneDistance distance(*input.scene.geometry);
    ProbeValues clearance = {"clearance", "m", "distance to the nearest surface", {}};
    for (const Vec3f& p : input.states.positions)
      clearance.values.push_back(static_cast<float>(distance.clearance(p)));
    all.push_back(std::move(clearance));
  }
#endif
  return all;
}

std::vector<std::string> splitLine(std::string line) {
  std::vector<std::string> words(1);
  for (const char c : line) {
    if (c == ',')
      words.emplace_back();
    else if (c != '\r' && c != '"')
      words.back().push_back(c);
  }
  return words;
}

std::vector<std::vector<std::string>> readCsvLines(const std::string& path) {
  std::vector<std::vector<std::string>> lines;
  const std::string text = readCsvFile(path);
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back(splitLine(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return lines;
}

double parseNumber(const std::string& text, const std::string& where) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    throwInput("{}: '{}' is no number", where, text);
  return value;
}

// The columns of the CSV, but for the index and the position.
std::vector<ProbeValues> csvValues(const std::string& path, std::size_t probes) {
  const std::vector<std::vector<std::string>> lines = readCsvLines(path);
  if (lines.empty()) throwInput("{}: is empty; a line with names must come first", path);
  const std::vector<std::string>& names = lines[0];
  const auto index = std::ranges::find_if(
      names, [](const std::string& name) { return name == "probe" || name == "index"; });
  if (index == names.end())
    throwInput("{}: line 1: needs a column 'probe' with the index of each probe", path);
  const auto key = static_cast<std::size_t>(index - names.begin());
  std::vector<ProbeValues> columns;
  std::vector<uint8_t> seen(probes, 0);
  for (const std::string& name : names)
    columns.push_back({name, "", "from " + path, std::vector<float>(probes, kNone)});
  for (std::size_t l = 1; l < lines.size(); ++l) {
    const std::string where = fmt::format("{}: line {}", path, l + 1);
    if (lines[l].size() != names.size())
      throwInput("{}: has {} columns, the first line {}", where, lines[l].size(), names.size());
    const double probe = parseNumber(lines[l][key], where);
    if (!(probe >= 0 && probe < static_cast<double>(probes)) || probe != std::floor(probe))
      throwInput("{}: there is no probe {}; the layout has {}, from 0 on", where, lines[l][key],
                 probes);
    if (seen[static_cast<std::size_t>(probe)]++ != 0)
      throwInput("{}: probe {} has had a line before", where, lines[l][key]);
    for (std::size_t c = 0; c < names.size(); ++c)
      if (!lines[l][c].empty())
        columns[c].values[static_cast<std::size_t>(probe)] =
            static_cast<float>(parseNumber(lines[l][c], where));
  }
  std::erase_if(columns, [&](const ProbeValues& column) {
    return column.name == names[key] || column.name == "x" || column.name == "y" ||
           column.name == "z";
  });
  return columns;
}

Json probesJson(const ReportLayoutInput& input, ReportPage& page) {
  const ProbeLayout& layout = input.layout;
  std::vector<float> positions;
  for (const Vec3f& p : input.states.positions) positions.insert(positions.end(), {p.x, p.y, p.z});
  const std::vector<uint8_t> states = probeStates(input);
  std::vector<ProbeValues> all = layoutValues(input);
  if (!input.values.empty())
    for (ProbeValues& column : csvValues(input.values, layout.positions.size()))
      all.push_back(std::move(column));
  Json values = Json::array();
  for (const ProbeValues& column : all)
    values.push_back({{"name", column.name},
                      {"unit", column.unit},
                      {"about", column.about},
                      {"blob", page.addBlob(floatBytes(column.values), "values of the probes")}});
  std::size_t moved = 0;
  for (std::size_t i = 0; i < layout.positions.size(); ++i)
    if (input.states.positions[i] != layout.positions[i]) ++moved;
  const auto count = [&](uint8_t state) { return std::ranges::count(states, state); };
  return {{"count", layout.positions.size()},
          {"positions", page.addBlob(floatBytes(positions), "positions of the probes")},
          {"states", page.addBlob(byteBytes(states), "states of the probes")},
          {"counts", {count(0), count(1), count(2)}},
          {"params", input.params.empty() ? Json(nullptr) : Json(input.params)},
          {"moved", moved},
          {"radius_m", 0.1 * static_cast<double>(layout.bias_length_m)},
          {"values", values}};
}

}  // namespace

Json reportLayout(const ReportLayoutInput& input, ReportPage& page) {
  const Scene& scene = input.scene;
  Box3f box = scene.geometry->box;
  for (const Vec3f& p : input.states.positions) box.extend(p);
  return {{"scene", scene.name},
          {"strategy", input.layout.strategy},
          {"interpolant", interpolantName(input.layout.interpolant)},
          {"origin", vectorJson(scene.origin)},
          {"box", {{"min", vectorJson(Vec3d(box.min))}, {"max", vectorJson(Vec3d(box.max))}}},
          {"triangles", trianglesJson(scene, page)},
          {"probes", probesJson(input, page)}};
}

}  // namespace probelab
