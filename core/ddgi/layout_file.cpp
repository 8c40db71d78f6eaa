// SPDX-License-Identifier: Apache-2.0
// The file is one JSON object; `readLayout` names its members. A place is three world coordinates,
// or six where adding the scene's origin loses bits: the last three are then local and exact.
#include "ddgi/layout_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "base/build_info.h"
#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "base/suggest.h"

namespace probelab {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "probelab layout 2";
constexpr uint64_t kMostPoints = uint64_t{1} << 28;  // of a lattice or a grid of corners
constexpr double kLargestFloat = std::numeric_limits<float>::max();

bool sameBits(const Vec3f& a, const Vec3f& b) {
  const auto bits = [](float x) { return std::bit_cast<uint32_t>(x); };
  return bits(a.x) == bits(b.x) && bits(a.y) == bits(b.y) && bits(a.z) == bits(b.z);
}

// Writing.

template <class T>
Json vectorJson(const Vec3<T>& v) {
  return Json::array({v.x, v.y, v.z});
}

Json placeJson(const Vec3f& local, const Scene& scene) {
  const Vec3d world = toWorld(scene, local);
  Json json = vectorJson(world);
  if (!sameBits(toLocal(scene, world), local))
    for (std::size_t i = 0; i < 3; ++i) json.push_back(static_cast<double>(local[i]));
  return json;
}

Json boxJson(const Box3f& box, const Scene& scene) {
  return {{"min", placeJson(box.min, scene)}, {"max", placeJson(box.max, scene)}};
}

Json latticeJson(const Lattice& lattice, const Scene& scene) {
  return {{"first", placeJson(lattice.first, scene)},
          {"spacing", vectorJson(Vec3d(lattice.spacing))},
          {"count", vectorJson(lattice.count)}};
}

// 16 hexadecimal digits an entry, its bytes in order.
std::string weightText(const std::vector<InfluenceEntry>& entries) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string text;
  text.reserve(entries.size() * 16);
  for (const InfluenceEntry& entry : entries)
    for (const uint8_t byte : entry.weights) {
      text.push_back(kDigits[byte >> 4]);
      text.push_back(kDigits[byte & 15]);
    }
  return text;
}

Json influenceJson(const InfluenceGrid& grid, const Scene& scene) {
  std::vector<uint32_t> probes;
  for (const InfluenceEntry& entry : grid.entries) probes.push_back(entry.probe);
  Json json = latticeJson(grid.corners, scene);
  json["voxel_begin"] = grid.voxel_begin;
  json["nearest"] = grid.nearest;
  json["entry_probes"] = probes;
  json["entry_weights"] = weightText(grid.entries);
  if (!grid.pieces.any()) return json;
  Json planes = Json::array();
  for (const Vec4f& f : grid.pieces.planes)
    for (const float x : {f.x, f.y, f.z, f.w}) planes.push_back(static_cast<double>(x));
  json["plane_of_voxel"] = grid.pieces.plane_of_voxel;
  json["planes"] = planes;
  return json;
}

Json probeJson(const ProbeLayout& layout, std::size_t i, const Scene& scene) {
  Json json = {{"position", placeJson(layout.positions[i], scene)}};
  if (!layout.lengths.empty()) {
    json["bias_m"] = static_cast<double>(layout.lengths[i].bias);
    json["support_m"] = static_cast<double>(layout.lengths[i].support);
  }
  if (!layout.pinned.empty()) json["pinned"] = layout.pinned[i] != 0;
  return json;
}

// Reading.

// Members of one JSON object; `where` begins every message.
struct Reader {
  const Json& object;
  std::string where;

  Reader(const Json& json, std::string place, const std::vector<std::string>& known)
      : object(json), where(std::move(place)) {
    if (!object.is_object()) throwInput("{}: must be an object", where);
    for (const auto& item : object.items())
      if (std::find(known.begin(), known.end(), item.key()) == known.end())
        throwInput("{}: unknown key '{}'{}", where, item.key(), suggestion(item.key(), known));
  }

  bool has(const char* name) const { return object.contains(name); }
  std::string path(const char* name) const { return fmt::format("{}: '{}'", where, name); }
  const Json& member(const char* name) const {
    const auto found = object.find(name);
    if (found == object.end()) throwInput("{} is missing", path(name));
    return *found;
  }
  const Json& list(const char* name) const {
    const Json& value = member(name);
    if (!value.is_array()) throwInput("{} must be a list", path(name));
    return value;
  }
  double number(const char* name, double least, double most) const {
    const Json& value = member(name);
    const double x = value.is_number() ? value.get<double>() : NAN;
    if (!(x >= least && x <= most))
      throwInput("{} must be a finite number from {:g} to {:g}", path(name), least, most);
    return x;
  }
  float positive(const char* name) const {
    return static_cast<float>(number(name, std::numeric_limits<float>::min(), kLargestFloat));
  }
  std::string text(const char* name) const {
    const Json& value = member(name);
    if (!value.is_string()) throwInput("{} must be a string", path(name));
    return value.get<std::string>();
  }
  uint64_t count(const char* name, uint64_t most = std::numeric_limits<uint64_t>::max()) const {
    return static_cast<uint64_t>(wholeNumber(member(name), path(name), 0, most));
  }
  // Whole numbers of a list, each from `least` to `most`.
  template <class T>
  std::vector<T> wholeNumbers(const char* name, int64_t least, uint64_t most) const {
    std::vector<T> values;
    for (const Json& value : list(name))
      values.push_back(static_cast<T>(wholeNumber(
          value, fmt::format("{}: '{}'[{}]", where, name, values.size()), least, most)));
    return values;
  }
  static int64_t wholeNumber(const Json& value, const std::string& what, int64_t least,
                             uint64_t most) {
    const bool negative =
        value.is_number_integer() && !value.is_number_unsigned() && value.get<int64_t>() < 0;
    if (!value.is_number_integer() ||
        (negative ? value.get<int64_t>() < least : value.get<uint64_t>() > most))
      throwInput("{} must be a whole number from {} to {}", what, least, most);
    return static_cast<int64_t>(value.get<uint64_t>());
  }
  std::vector<double> numbers(const char* name, std::size_t few, std::size_t many) const {
    std::vector<double> values;
    for (const Json& value : list(name))
      values.push_back(value.is_number() ? value.get<double>() : NAN);
    bool good = values.size() == few || values.size() == many;
    for (const double value : values) good = good && std::abs(value) <= kLargestFloat;
    if (!good) throwInput("{} must be {} finite numbers", path(name), few);
    return values;
  }
  Vec3f vector(const char* name) const {
    const std::vector<double> v = numbers(name, 3, 3);
    return Vec3f(Vec3d(v[0], v[1], v[2]));
  }
  Vec3f place(const char* name, const Scene& scene) const {
    const std::vector<double> v = numbers(name, 3, 6);
    const Vec3f local = toLocal(scene, Vec3d(v[0], v[1], v[2]));
    if (v.size() == 3) return local;
    // The two must be one place: rounding of the sum with the origin, and of fp32.
    const Vec3f exact(Vec3d(v[3], v[4], v[5]));
    for (std::size_t i = 0; i < 3; ++i)
      if (std::abs(static_cast<double>(exact[i]) + scene.origin[i] - v[i]) >
          1e-6 * std::abs(v[3 + i]) + 1e-15 * std::abs(v[i]))
        throwInput("{}: world and local coordinates differ; leave the local ones out", path(name));
    return exact;
  }
};

// Throws InputError for what is no JSON object or names a member twice.
Json parseObject(const std::string& text, const std::string& file) {
  std::vector<std::set<std::string>> names;  // of the objects that are open
  std::string twice;
  const auto watch = [&](int, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::object_start) names.emplace_back();
    if (event == Json::parse_event_t::object_end) names.pop_back();
    if (event == Json::parse_event_t::key && !names.back().insert(parsed.get<std::string>()).second)
      twice = parsed.get<std::string>();
    return true;
  };
  Json json = Json::parse(text, watch, false);
  if (json.is_discarded() || !json.is_object())
    throwInput("{}: not a JSON object; `probelab place` writes such files", file);
  if (!twice.empty()) throwInput("{}: key '{}' stands twice", file, twice);
  return json;
}

Box3f readBox(const Json& json, const std::string& where, const Scene& scene) {
  const Reader reader(json, where, {"min", "max"});
  const Box3f box{reader.place("min", scene), reader.place("max", scene)};
  if (minComponent(box.extent()) <= 0) throwInput("{}: the box is empty", where);
  return box;
}

Lattice readLattice(const Reader& reader, const Scene& scene) {
  Lattice lattice;
  lattice.first = reader.place("first", scene);
  lattice.spacing = reader.vector("spacing");
  if (minComponent(lattice.spacing) <= 0) throwInput("{}: 'spacing' must be above 0", reader.where);
  const auto count = reader.wholeNumbers<int>("count", 1, kMostPoints);
  if (count.size() != 3) throwInput("{}: 'count' must be three numbers", reader.where);
  uint64_t points = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    lattice.count[axis] = count[axis];
    points *= static_cast<uint64_t>(count[axis]);
    if (points > kMostPoints) throwInput("{}: 'count': more than 2^28 points", reader.where);
  }
  return lattice;
}

int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

InfluenceGrid readInfluence(const Json& json, const std::string& where, const Scene& scene) {
  const Reader reader(
      json, where,
      {"first", "spacing", "count", "voxel_begin", "nearest", "entry_probes", "entry_weights",
       "plane_of_voxel", "planes"});
  InfluenceGrid grid;
  grid.corners = readLattice(reader, scene);
  constexpr uint64_t kMost = std::numeric_limits<uint32_t>::max();
  grid.voxel_begin = reader.wholeNumbers<uint32_t>("voxel_begin", 0, kMost);
  grid.nearest = reader.wholeNumbers<int32_t>("nearest", 0, kMost / 2);
  const std::string weights = reader.text("entry_weights");
  const auto probes = reader.wholeNumbers<uint32_t>("entry_probes", 0, kMost);
  if (weights.size() != probes.size() * 16)
    throwInput("{}: 'entry_weights' must be 16 hexadecimal digits an entry, {} in all", where,
               probes.size() * 16);
  for (std::size_t e = 0; e < probes.size(); ++e) {
    InfluenceEntry entry{probes[e], {}};
    for (std::size_t k = 0; k < 8; ++k) {
      const int high = hexDigit(weights[e * 16 + 2 * k]);
      const int low = hexDigit(weights[e * 16 + 2 * k + 1]);
      if (high < 0 || low < 0)
        throwInput("{}: 'entry_weights': digits of entry {} are not 0-9, a-f", where, e);
      entry.weights[k] = static_cast<uint8_t>(high * 16 + low);
    }
    grid.entries.push_back(entry);
  }
  if (!reader.has("planes") && !reader.has("plane_of_voxel")) return grid;
  grid.pieces.plane_of_voxel = reader.wholeNumbers<int32_t>("plane_of_voxel", -1, kMost / 2);
  const std::size_t numbers = reader.list("planes").size();
  const std::vector<double> planes = reader.numbers("planes", numbers, numbers);
  if (numbers % 4 != 0) throwInput("{} must be 4 numbers a plane", reader.path("planes"));
  for (std::size_t i = 0; i < numbers; i += 4)
    grid.pieces.planes.emplace_back(
        static_cast<float>(planes[i]), static_cast<float>(planes[i + 1]),
        static_cast<float>(planes[i + 2]), static_cast<float>(planes[i + 3]));
  return grid;
}

void readProbes(const Reader& root, const Scene& scene, ProbeLayout& layout) {
  const Json& list = root.list("probes");
  const bool scattered = layout.interpolant != Interpolant::lattice;
  std::vector<std::string> known = {"position", "pinned"};
  if (scattered) known.insert(known.end(), {"bias_m", "support_m"});
  bool any_pinned = false;
  for (const Json& json : list) {
    const Reader reader(json, fmt::format("{}: probes[{}]", root.where, layout.positions.size()),
                        known);
    layout.positions.push_back(reader.place("position", scene));
    if (scattered)
      layout.lengths.push_back({reader.positive("bias_m"), reader.positive("support_m")});
    layout.pinned.push_back(0);
    if (!reader.has("pinned")) continue;
    any_pinned = true;
    if (!reader.member("pinned").is_boolean())
      throwInput("{} must be true or false", reader.path("pinned"));
    layout.pinned.back() = reader.member("pinned").get<bool>() ? 1 : 0;
  }
  if (!any_pinned) layout.pinned.clear();
}

void checkBelongs(const Reader& root, const Scene& scene) {
  if (root.text("geometry_hash") != geometryHash(scene))
    throwInput(
        "{}: this layout was made for the geometry of {} as it was then, not for {}; run "
        "`probelab place` again",
        root.where, root.text("scene"), scene.path);
  const Box3f volume = readBox(root.member("volume"), root.path("volume"), scene);
  if (!sameBits(volume.min, scene.bounds.min) || !sameBits(volume.max, scene.bounds.max))
    throwInput(
        "{}: this layout was made for another [volume] of {}; run `probelab place` again, or "
        "restore the volume",
        root.where, scene.path);
}

Interpolant readInterpolant(const Reader& root) {
  try {
    return parseInterpolant(root.text("interpolant"));
  } catch (const InputError& error) {
    throwInput("{}: {}", root.where, error.what());
  }
}

void readOptions(const Reader& root, ProbeLayout& layout) {
  const Json& options = root.member("options");
  if (!options.is_object()) throwInput("{} must be an object", root.path("options"));
  for (const auto& item : options.items()) {
    if (!item.value().is_string())
      throwInput("{}: '{}' must be a string", root.path("options"), item.key());
    layout.options[item.key()] = item.value().get<std::string>();
  }
}

}  // namespace

std::string geometryHash(const Scene& scene) {
  std::vector<std::byte> bytes;
  const auto add = [&](const auto* data, std::size_t count) {
    const auto* begin = reinterpret_cast<const std::byte*>(data);
    bytes.insert(bytes.end(), begin, begin + count * sizeof(*data));
  };
  const double origin[3] = {scene.origin.x, scene.origin.y, scene.origin.z};
  add(origin, 3);
  if (scene.geometry) {
    add(scene.geometry->positions.data(), scene.geometry->positions.size());
    for (const Triangle& triangle : scene.geometry->triangles) add(triangle.vertex, 3);
  }
  return contentHash(bytes);
}

void writeLayout(const std::filesystem::path& path, const ProbeLayout& layout, const Scene& scene) {
  Json root;
  root["format"] = kFormat;
  root["version"] = buildInfo().version;
  root["scene"] = scene.path;
  root["scene_hash"] = scene.content_hash;
  root["geometry_hash"] = geometryHash(scene);
  root["volume"] = boxJson(scene.bounds, scene);
  root["strategy"] = layout.strategy;
  root["options"] = layout.options;
  if (layout.options.empty()) root["options"] = Json::object();
  root["asked"] = layout.asked;
  root["seed"] = layout.seed;
  root["evaluations"] = layout.evaluations;
  root["build_s"] = layout.build_s;
  root["interpolant"] = interpolantName(layout.interpolant);
  root["bounds"] = boxJson(layout.bounds, scene);
  root["bias_length_m"] = static_cast<double>(layout.bias_length_m);
  root["support_radius_m"] = static_cast<double>(layout.support_radius_m);
  // One member a line, then one probe a line.
  std::string text = "{\n";
  for (const auto& item : root.items())
    text += fmt::format(" {}: {},\n", Json(item.key()).dump(), item.value().dump());
  if (layout.interpolant == Interpolant::lattice) {
    Json lattice = latticeJson(layout.lattice, scene);
    lattice["probe_of_point"] = layout.probe_of_point;
    text += fmt::format(" \"lattice\": {},\n", lattice.dump());
  } else {
    text += fmt::format(" \"influence\": {},\n", influenceJson(layout.influence, scene).dump());
  }
  text += " \"probes\": [";
  for (std::size_t i = 0; i < layout.positions.size(); ++i)
    text += (i == 0 ? "\n  " : ",\n  ") + probeJson(layout, i, scene).dump();
  writeTextFile(path, text + "\n ]\n}\n");
}

namespace {

constexpr float kSlack = 1e-3f;         // of a spacing
constexpr float kLongestLength = 1e3f;  // of the bounds' diagonal

// Of any coordinate of a probe: a diagonal beyond the bounds.
float farthestPlace(const Box3f& bounds) {
  return std::max(maxComponent(componentMax(bounds.min * -1.0f, bounds.max)), 0.0f) +
         length(bounds.extent());
}

// What a strategy never writes though each number alone would do: probes far from the bounds or
// away from their lattice points, voxels that do not lie in the bounds, lengths beyond all measure.
void checkPlaces(const ProbeLayout& layout, const std::string& file) {
  const float longest = kLongestLength * length(layout.bounds.extent());
  if (!(layout.bias_length_m < longest) || !(layout.support_radius_m < longest))
    throwInput("{}: lengths of {} and {} m do not go with bounds of {} m", file,
               layout.bias_length_m, layout.support_radius_m, length(layout.bounds.extent()));
  for (const ProbeLengths& of_probe : layout.lengths)
    if (!(of_probe.bias < longest))
      throwInput("{}: a probe's length of {} m does not go with bounds of {} m", file,
                 of_probe.bias, length(layout.bounds.extent()));
  for (std::size_t i = 0; i < layout.positions.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (!(std::abs(layout.positions[i][axis]) <= farthestPlace(layout.bounds)))
        throwInput("{}: probe {} lies far from the bounds", file, i);
  for (std::size_t i = 0; i < layout.probe_of_point.size(); ++i) {
    if (layout.probe_of_point[i] < 0) continue;
    const auto probe = static_cast<std::size_t>(layout.probe_of_point[i]);
    const Vec3f away = (layout.positions[probe] - layout.lattice.position(static_cast<int>(i))) /
                       layout.lattice.spacing;
    if (!(length(away) <= 1 + kSlack))
      throwInput("{}: probe {} lies {:g} spacings from its lattice point", file, probe,
                 length(away));
  }
  if (layout.interpolant == Interpolant::lattice) return;
  const Lattice& corners = layout.influence.corners;
  const Vec3f last = corners.position(corners.pointCount() - 1), slack = corners.spacing * kSlack;
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (!(corners.first[axis] >= layout.bounds.min[axis] - slack[axis]) ||
        !(last[axis] <= layout.bounds.max[axis] + slack[axis]))
      throwInput("{}: influence: its voxels do not lie within the bounds", file);
}

}  // namespace

ProbeLayout readLayout(const std::filesystem::path& path, const Scene& scene) {
  const std::string file = path.string();
  const Json json = parseObject(readTextFile(path), file);
  const Reader root(
      json, file,
      {"format", "version", "scene", "scene_hash", "geometry_hash", "volume", "strategy", "options",
       "asked", "seed", "evaluations", "build_s", "interpolant", "bounds", "bias_length_m",
       "support_radius_m", "lattice", "influence", "probes"});
  if (root.text("format") != kFormat)
    throwInput("{}: 'format' is '{}', must be '{}'; 'probelab place' makes the layout anew", file,
               root.text("format"), kFormat);
  checkBelongs(root, scene);
  for (const char* name : {"version", "scene_hash"}) root.text(name);
  ProbeLayout layout;
  layout.strategy = root.text("strategy");
  readOptions(root, layout);
  layout.asked = static_cast<int>(root.count("asked", 1u << 24));
  layout.seed = root.count("seed");
  layout.evaluations = root.count("evaluations");
  layout.build_s = root.number("build_s", 0, std::numeric_limits<double>::max());
  layout.interpolant = readInterpolant(root);
  layout.bounds = readBox(root.member("bounds"), root.path("bounds"), scene);
  layout.bias_length_m = root.positive("bias_length_m");
  layout.support_radius_m = root.positive("support_radius_m");
  const bool on_lattice = layout.interpolant == Interpolant::lattice;
  if (const char* other = on_lattice ? "influence" : "lattice"; root.has(other))
    throwInput("{} does not go with interpolant '{}'", root.path(other), root.text("interpolant"));
  readProbes(root, scene, layout);
  if (layout.asked > 0 && layout.positions.size() > static_cast<std::size_t>(layout.asked))
    throwInput("{} is {}, but there are {} probes", root.path("asked"), layout.asked,
               layout.positions.size());
  if (on_lattice) {
    const Reader reader(root.member("lattice"), root.path("lattice"),
                        {"first", "spacing", "count", "probe_of_point"});
    layout.lattice = readLattice(reader, scene);
    layout.probe_of_point =
        reader.wholeNumbers<int>("probe_of_point", -1, std::numeric_limits<int>::max());
  } else {
    layout.influence = readInfluence(root.member("influence"), root.path("influence"), scene);
  }
  validateLayout(layout, file);
  checkPlaces(layout, file);
  return layout;
}

}  // namespace probelab
