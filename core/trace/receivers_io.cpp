// SPDX-License-Identifier: Apache-2.0
// Receivers as files: JSON with truth, CSV with bare points.
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/error.h"
#include "base/files.h"
#include "receiver_points.h"

namespace probelab {
namespace {

using Json = nlohmann::ordered_json;

Json toJson(const Vec3d& v) { return Json::array({v.x, v.y, v.z}); }
Json toJson(const Vec3f& v) { return toJson(Vec3d(v)); }

Json toJson(const Receiver& r, const Scene& scene) {
  return {{"position", toJson(toWorld(scene, r.position))},
          {"normal", toJson(r.normal)},
          {"view", toJson(r.view)},
          {"area", r.area},
          {"kind", receiverKindName(r.kind)},
          {"region", r.region},
          {"split", r.split == Split::train ? "train" : "heldout"},
          {"a", toJson(r.a)},
          {"b", toJson(r.b)}};
}

// Reads members of one JSON object; `where` begins every message.
struct Reader {
  const Json& object;
  std::string where;

  const Json& member(const char* name) const {
    const auto found = object.find(name);
    if (found == object.end()) throwInput("{}: '{}' is missing", where, name);
    return *found;
  }
  double number(const char* name) const {
    const Json& value = member(name);
    if (!value.is_number() || !std::isfinite(value.get<double>()))
      throwInput("{}: '{}' must be a finite number", where, name);
    return value.get<double>();
  }
  uint64_t count(const char* name) const {
    const Json& value = member(name);
    if (!value.is_number_integer() || (!value.is_number_unsigned() && value.get<int64_t>() < 0))
      throwInput("{}: '{}' must be a whole number, 0 or more", where, name);
    return value.get<uint64_t>();
  }
  std::string text(const char* name) const {
    const Json& value = member(name);
    if (!value.is_string()) throwInput("{}: '{}' must be a string", where, name);
    return value.get<std::string>();
  }
  Vec3d vector(const char* name) const {
    const Json& value = member(name);
    Vec3d v;
    bool good = value.is_array() && value.size() == 3;
    for (std::size_t i = 0; good && i < 3; ++i) {
      good = value[i].is_number() && std::isfinite(value[i].get<double>());
      if (good) v[i] = value[i].get<double>();
    }
    if (!good) throwInput("{}: '{}' must be three finite numbers", where, name);
    return v;
  }
  // Of the truth: what the path tracer says is never negative.
  Vec3f irradiance(const char* name) const {
    const Vec3d v = vector(name);
    if (!(minComponent(v) >= 0)) throwInput("{}: '{}' must not be negative", where, name);
    return Vec3f(v);
  }
  Vec3f unitVector(const char* name) const {
    const Vec3d v = vector(name);
    if (std::abs(length(v) - 1) > 1e-4) throwInput("{}: '{}' must have length 1", where, name);
    return Vec3f(v);
  }
  int region() const {
    const double value = number("region");
    if (value != std::floor(value) || value < -1 || value > 1e9)
      throwInput("{}: 'region' must be a whole number, -1 or more", where);
    return static_cast<int>(value);
  }
};

constexpr float kFarthest = 1e6f;  // of the bounds' diagonal: farther off rays lose the scene

void checkNear(const Vec3f& position, const std::string& where, const Scene& scene) {
  if (!isFinite(position) || !(length(position) <= kFarthest * length(scene.bounds.extent())))
    throwInput("{}: the position is more than {:g} times the scene's size away", where, kFarthest);
}

ReceiverKind parseKind(const Reader& reader) {
  const std::string text = reader.text("kind");
  for (const ReceiverKind kind : {ReceiverKind::surface, ReceiverKind::volume, ReceiverKind::point})
    if (text == receiverKindName(kind)) return kind;
  throwInput("{}: 'kind' is '{}', must be 'surface', 'volume' or 'point'", reader.where, text);
}

Split parseSplit(const Reader& reader) {
  const std::string text = reader.text("split");
  if (text == "train") return Split::train;
  if (text == "heldout") return Split::heldout;
  throwInput("{}: 'split' is '{}', must be 'train' or 'heldout'", reader.where, text);
}

Receiver parseReceiver(const Reader& reader, const Scene& scene) {
  Receiver r;
  r.position = toLocal(scene, reader.vector("position"));
  checkNear(r.position, reader.where, scene);
  r.normal = reader.unitVector("normal");
  r.view = reader.unitVector("view");
  r.area = reader.number("area");
  if (!(r.area >= 0)) throwInput("{}: 'area' must not be negative", reader.where);
  r.kind = parseKind(reader);
  r.region = reader.region();
  r.split = parseSplit(reader);
  r.a = reader.irradiance("a");
  r.b = reader.irradiance("b");
  return r;
}

void checkBelongs(const Receivers& receivers, const Scene& scene, const std::string& file) {
  if (receivers.scene_hash != scene.content_hash)
    throwInput(
        "{}: these receivers were made for {} as it was then (content {}), not for {} "
        "(content {}); run `probelab receivers` again",
        file, receivers.scene_path, receivers.scene_hash, scene.path, scene.content_hash);
  if (receivers.state != scene.state)
    throwInput(
        "{}: these receivers hold the truth of lighting state '{}', not of '{}'; choose "
        "that state or run `probelab receivers` for this one",
        file, receivers.state, scene.state);
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

bool parseNumber(std::string_view text, double& value) {
  text = trimmed(text);
  if (!text.empty() && text[0] == '+') text.remove_prefix(1);
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  return result.ec == std::errc() && result.ptr == text.data() + text.size() &&
         std::isfinite(value);
}

std::vector<std::string_view> splitFields(std::string_view line) {
  std::vector<std::string_view> fields;
  for (std::size_t begin = 0;;) {
    const std::size_t comma = line.find(',', begin);
    fields.push_back(line.substr(begin, comma - begin));
    if (comma == std::string_view::npos) return fields;
    begin = comma + 1;
  }
}

Receiver parsePoint(std::string_view line, const std::string& where, const Scene& scene) {
  const auto fields = splitFields(line);
  if (fields.size() != 6)
    throwInput("{}: {} values, must be the six of x,y,z,nx,ny,nz", where, fields.size());
  double v[6];
  for (std::size_t i = 0; i < 6; ++i)
    if (!parseNumber(fields[i], v[i]))
      throwInput("{}: '{}' is not a finite number", where, trimmed(fields[i]));
  const Vec3d normal(v[3], v[4], v[5]);
  const double l = length(normal);
  if (!(l > 1e-12) || !std::isfinite(l)) throwInput("{}: the normal has no direction", where);
  Receiver r;
  r.position = toLocal(scene, Vec3d(v[0], v[1], v[2]));
  r.normal = Vec3f(normal / l);
  checkNear(r.position, where, scene);
  return r;
}

}  // namespace

Receivers readReceiverPoints(const std::filesystem::path& csv, const Scene& scene,
                             const EmbreeScene& embree, const Reachability& reachability) {
  const std::string text = readCsvFile(csv);
  Receivers receivers;
  bool may_be_header = true;
  std::size_t number = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = trimmed(std::string_view(text).substr(begin, end - begin));
    begin = end + 1;
    ++number;
    if (line.empty() || line[0] == '#') continue;
    double ignored;
    const bool header = may_be_header && !parseNumber(splitFields(line)[0], ignored) &&
                        trimmed(splitFields(line)[0]) == "x";
    may_be_header = false;
    if (header) continue;
    receivers.points.push_back(
        parsePoint(line, fmt::format("{}: line {}", csv.string(), number), scene));
  }
  if (receivers.points.empty())
    throwInput("{}: no points; each line must be x,y,z,nx,ny,nz", csv.string());
  placePoints(receivers, scene, embree, reachability);
  return receivers;
}

void writeReceivers(const std::filesystem::path& path, const Receivers& receivers,
                    const Scene& scene) {
  Json root;
  root["scene"] = receivers.scene_path;
  root["scene_hash"] = receivers.scene_hash;
  root["state"] = receivers.state;
  root["seed"] = receivers.seed;
  root["samples"] = receivers.samples;
  root["rel_error"] = receivers.rel_error;
  root["seconds"] = receivers.seconds;
  root["rays"] = receivers.rays;
  root["version"] = receivers.version;
  // One receiver a line.
  std::string text = root.dump(1);
  text.resize(text.rfind('\n'));
  text += ",\n \"receivers\": [";
  const char* separator = "\n  ";
  for (const Receiver& r : receivers.points) {
    text += separator + toJson(r, scene).dump();
    separator = ",\n  ";
  }
  writeTextFile(path, text + "\n ]\n}\n");
}

Receivers readReceivers(const std::filesystem::path& path, const Scene& scene) {
  const std::string file = path.string();
  const Json root = Json::parse(readTextFile(path), nullptr, false);
  if (root.is_discarded() || !root.is_object())
    throwInput("{}: not a JSON object; `probelab receivers` writes such files", file);
  const Reader reader{root, file};
  Receivers receivers;
  receivers.scene_path = reader.text("scene");
  receivers.scene_hash = reader.text("scene_hash");
  receivers.state = reader.text("state");
  checkBelongs(receivers, scene, file);
  receivers.seed = reader.count("seed");
  receivers.samples = static_cast<uint32_t>(reader.count("samples"));
  receivers.rel_error = reader.number("rel_error");
  receivers.seconds = reader.number("seconds");
  receivers.rays = reader.count("rays");
  receivers.version = reader.text("version");
  const Json& list = reader.member("receivers");
  if (!list.is_array() || list.empty())
    throwInput("{}: 'receivers' must be a list that is not empty", file);
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string where = fmt::format("{}: receivers[{}]", file, i);
    if (!list[i].is_object()) throwInput("{}: must be an object", where);
    receivers.points.push_back(parseReceiver({list[i], where}, scene));
  }
  return receivers;
}

}  // namespace probelab
