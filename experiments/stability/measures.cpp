// SPDX-License-Identifier: GPL-3.0-or-later
#include "measures.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/interrupt.h"
#include "hostile_files.h"

namespace probelab {
namespace {

using std::numbers::pi;

constexpr int kMostBounces = 5000;
constexpr int kDitherAverage = 64;  // updates, of which one alone is noise

float f(double x) { return static_cast<float>(x); }

// The room at its place; its lamp is scale^2 times as bright, so that E stays what it is.
Scene pillarRoom(const PillarPlace& place) {
  const float scale = f(place.scale);
  const Vec3f at(f(place.metres));
  SceneBuilder builder;
  builder.box(at, at + Vec3f(4, 2, 2) * scale, builder.material(Vec3f(0.6f, 0.5f, 0.4f)), true);
  builder.box(at + Vec3f(1.4f, 0, 0.6f) * scale, at + Vec3f(1.9f, 1.3f, 1.1f) * scale,
              builder.material(Vec3f(0.3f), Vec3f(0.2f, 0.5f, 1)), false);
  builder.pointLight(at + Vec3f(3.1f, 1.7f, 0.7f) * scale, Vec3f(2 * scale * scale));
  return builder.finish();
}

// The room's triangles as a glTF of two materials, under a node that lies far away.
TinyGltf pillarFile(double metres) {
  const Scene room = pillarRoom({});
  std::vector<float> positions;
  for (const Vec3f& p : room.geometry->positions) positions.insert(positions.end(), {p.x, p.y, p.z});
  std::vector<uint16_t> indices;
  for (const Triangle& t : room.geometry->triangles)
    for (const uint32_t v : t.vertex) indices.push_back(static_cast<uint16_t>(v));
  TinyGltf gltf(positions, indices);
  const std::size_t half = indices.size() / 2;  // the room's box first, then the pillar
  gltf.root["accessors"][1]["count"] = half;
  gltf.root["accessors"].push_back({{"bufferView", 1},
                                    {"byteOffset", 2 * half},
                                    {"componentType", 5123},
                                    {"type", "SCALAR"},
                                    {"count", half}});
  const auto material = [](const std::vector<double>& color, const std::vector<double>& emission) {
    return nlohmann::json{
        {"pbrMetallicRoughness", {{"baseColorFactor", color}, {"metallicFactor", 0}}},
        {"emissiveFactor", emission}};
  };
  gltf.root["materials"] = {material({0.6, 0.5, 0.4, 1}, {0, 0, 0}),
                            material({0.3, 0.3, 0.3, 1}, {0.2, 0.5, 1})};
  gltf.root["meshes"][0]["primitives"].push_back(
      {{"attributes", {{"POSITION", 0}}}, {"indices", 2}, {"material", 1}});
  gltf.root["nodes"][0]["translation"] = {metres, metres, metres};
  return gltf;
}

// The same room by way of a file: local coordinates are relative to its middle.
Scene pillarFromFile(Workbench& bench, double metres) {
  Scene scene = loadTiny(bench, pillarFile(metres));
  Light lamp = pillarRoom({}).lights.front();
  lamp.position = toLocal(scene, Vec3d(metres) + Vec3d(lamp.position));
  scene.base_lights = scene.lights = {lamp};
  scene.light_colors = {lamp.intensity};
  scene.light_intensities = {1};
  return scene;
}

}  // namespace

Answers pillarAnswers(Workbench& bench, const CaseVariant& variant, Params params,
                      const PillarPlace& place) {
  params.rays = 64;
  const BuiltScene scene(place.rebased ? pillarFromFile(bench, place.metres) : pillarRoom(place));
  const auto local = [&](const Vec3f& p) {
    if (place.rebased) return toLocal(scene.scene, Vec3d(place.metres) + Vec3d(p));
    return p * f(place.scale) + Vec3f(f(place.metres));
  };
  std::vector<QueryPoint> points = randomPoints({Vec3f(0.1f), Vec3f(3.9f, 1.9f, 1.9f)}, 100, 4);
  for (QueryPoint& p : points) p.position = local(p.position);
  const ProbeLayout layout = fullLattice({local(Vec3f(0.25f)), local(Vec3f(3.75f, 1.75f, 1.75f))},
                                         Vec3i(4, 2, 2), scene.scene.bounds);
  return answersAt(bench, scene, layout, params, points, variant, {.samples = place.samples});
}

double rmsDifference(const Answers& answers, const Answers& base) {
  double sum = 0, all = 0;
  for (std::size_t i = 0; i < base.e.size(); ++i) {
    sum += (answers.e[i] - base.e[i]) * (answers.e[i] - base.e[i]);
    all += base.e[i] * base.e[i];
  }
  return std::sqrt(sum / all);
}

double meanDifference(const Answers& answers, const Answers& base) {
  double sum = 0, all = 0;
  for (std::size_t i = 0; i < base.e.size(); ++i) sum += answers.e[i], all += base.e[i];
  return std::abs(sum / all - 1);
}

double shiftedError(Workbench& bench, const CaseVariant& variant, double metres) {
  const Vec3f at(f(metres));
  SceneBuilder builder;
  builder.box(at, at + Vec3f(2), builder.material(Vec3f(0.5f), Vec3f(1)), true);
  const BuiltScene scene(builder.finish());
  Params params = exactParams("rtxgi");
  params.rays = 64;
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params, variant);
  convergeField(*field, {.average = 4});
  std::vector<QueryPoint> points = furnacePoints();
  for (QueryPoint& p : points) p.position += at;
  return worstError(field->query(points), pi / 0.5);
}

Scene twoRooms(double thickness, double albedo, double spacing, double metres) {
  SceneBuilder builder;
  const uint32_t bright = builder.material(Vec3f(f(albedo)), Vec3f(1));
  const uint32_t dark = builder.material(Vec3f(f(albedo)));
  const double s = spacing / 0.5, half = thickness / 2;
  const auto at = [&](double x, double y, double z) {
    return Vec3f(f(metres + x), f(s * y), f(s * z));
  };
  if (thickness > 0) {
    builder.box(at(-2 * s, 0, 0), at(-half, 2, 2), bright, true);
    builder.box(at(half, 0, 0), at(2 * s, 2, 2), dark, true);
  } else {
    builder.box(at(-2 * s, 0, 0), at(2 * s, 2, 2), dark, true);
    builder.box(at(-1.5 * s, 0.5, 0.5), at(-s, 1, 1), bright, false);
    const uint32_t sheet = builder.material(Vec3f(f(albedo)), Vec3f(), true);
    builder.quad(at(0, -0.1, -0.1), at(0, -0.1, 2.1), at(0, 2.1, 2.1), at(0, 2.1, -0.1), sheet);
  }
  return builder.finish();
}

double wallLeak(Workbench& bench, const CaseVariant& variant, const Params& params,
                double thickness, double spacing, double metres) {
  const BuiltScene scene(twoRooms(thickness, 0, spacing, metres));
  const double s = spacing / 0.5;
  const auto at = [&](double x, double y, double z) {
    return Vec3f(f(metres + x), f(s * y), f(s * z));
  };
  const ProbeLayout layout = fullLattice({at(-1.75 * s, 0.25, 0.25), at(1.75 * s, 1.75, 1.75)},
                                         Vec3i(8, 4, 4), scene.scene.bounds);
  const std::vector<QueryPoint> points =
      randomPoints({at(thickness / 2, 0.2, 0.2), at(0.25 * s, 1.8, 1.8)}, 200, 7);
  double sum = 0;
  for (const double e :
       answersAt(bench, scene, layout, params, points, variant, {.samples = 64, .updates = 1}).e)
    sum += e / pi / 200;
  return sum;
}

double leakedShare(Workbench& bench, Params params, double dark) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(4), builder.material(Vec3f(0), Vec3f(f(dark))), true);
  builder.box(Vec3f(5, 0, 0), Vec3f(9, 4, 4), builder.material(Vec3f(0), Vec3f(1)), true);
  builder.scene().bounds = {Vec3f(0), Vec3f(9, 4, 4)};
  const BuiltScene scene(builder.finish());
  params.encoding_gamma = 1;
  params.average = PL_AVERAGE_LINEAR;
  const auto field = bench.field(
      scene,
      fullLattice({Vec3f(1.9f, 1, 1), Vec3f(7.1f, 3, 3)}, Vec3i(2, 2, 2), scene.scene.bounds),
      params);
  field->update(0, {}, {});
  const std::vector<QueryPoint> point{upAt(Vec3f(3.9f, 2, 2))};
  const double answer = static_cast<double>(field->query(point).front().y) / pi;
  return (answer - dark) / (1 - dark);  // -dark: black
}

double storedError(Workbench& bench, const Params& params, double x) {
  // Powers of two and what is near them are stored without an error.
  constexpr double kShares[] = {1, 0.987, 0.974, 0.961};
  constexpr int kBoxes = 5;
  SceneBuilder builder;
  std::vector<QueryPoint> points;
  for (int i = 0; i < kBoxes; ++i) {
    const Vec3f middle(2 * static_cast<float>(i), 0, 0);
    const double radiance = i == 0 ? 1 : x * kShares[i - 1];
    builder.box(middle - Vec3f(0.5f), middle + Vec3f(0.5f),
                builder.material(Vec3f(0), Vec3f(f(radiance))), true);
    if (i > 0) points.push_back(upAt(middle));
  }
  builder.scene().bounds = {Vec3f(-1), Vec3f(9, 1, 1)};
  const BuiltScene scene(builder.finish());
  const auto field = bench.field(
      scene,
      fullLattice({Vec3f(0, -0.25f, -0.25f), Vec3f(8, 0.25f, 0.25f)}, Vec3i(kBoxes, 1, 1),
                  scene.scene.bounds),
      params);
  field->update(0, {}, {});
  const std::vector<Vec4f> answers = field->query(points);
  double worst = 0;
  for (std::size_t i = 0; i < answers.size(); ++i)
    worst = larger(worst, worstError(std::span(&answers[i], 1), pi * x * kShares[i]));
  return worst;
}

double albedoError(Workbench& bench, const CaseVariant& variant, const Params& params,
                   double albedo) {
  constexpr double kLevel = 0.6;
  const float rho = f(albedo), emission = f(kLevel * (1 - albedo));
  const BuiltScene scene(furnace(rho, emission));
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params, variant);
  const double r = static_cast<double>(rho);
  const int bounces =
      r > 0 ? std::clamp(static_cast<int>(std::ceil(std::log(0.01) / std::log(r))), 1, kMostBounces)
            : 1;
  const int average = params.rounding == 0 ? 1 : kDitherAverage;
  const std::vector<QueryPoint> points = furnacePoints();
  double sum = 0, truth = 0;
  for (int u = 1; u < bounces + average; ++u) {
    throwIfInterrupted();
    field->update(0, {}, {});
    if (u < bounces) continue;
    for (const Vec4f& e : field->query(points)) sum += static_cast<double>(e.y);
    truth += static_cast<double>(points.size()) * pi * static_cast<double>(emission) *
             (1 - std::pow(r, u)) / (1 - r);
  }
  return std::abs(sum / truth - 1);
}

}  // namespace probelab
