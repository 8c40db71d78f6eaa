// SPDX-License-Identifier: GPL-3.0-or-later
// What must not matter: the unit of length, where the scene lies, its handedness, its orientation,
// the seed.
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include "scene/load.h"
#include "update_oracle.h"

namespace probelab {
namespace {

using test::boxLayout;
using test::exactParams;
using test::FieldScene;

class Invariance : public GpuTest {};

using Map = std::function<Vec3f(const Vec3f&)>;

// The scene under a linear map of its points; point lights `brighter` times as bright. A mirror
// turns triangles around, so that their fronts stay fronts.
Scene mapped(Scene scene, const Map& map, float brighter, bool mirror) {
  Geometry geometry = *scene.geometry;
  geometry.box = {};
  scene.bounds = {};
  for (Vec3f& p : geometry.positions) geometry.box.extend(p = map(p));
  if (mirror)
    for (Triangle& t : geometry.triangles) std::swap(t.vertex[1], t.vertex[2]);
  const Vec3f margin(0.01f * geometry.box.diagonal());
  scene.bounds = {geometry.box.min - margin, geometry.box.max + margin};
  for (Light& light : scene.lights) {
    light.position = map(light.position);
    light.intensity *= Vec3f(brighter);
  }
  scene.geometry = std::make_shared<const Geometry>(std::move(geometry));
  return scene;
}

std::vector<QueryPoint> points(int n) {
  Rng rng(2, RngStream::test, 5);
  std::vector<QueryPoint> result;
  for (int i = 0; i < n; ++i) {
    Vec3f normal(2 * rng.nextFloat() - 1, 2 * rng.nextFloat() - 1, 2 * rng.nextFloat() - 1);
    normal = normalize(normal);
    const Vec3f u(rng.nextFloat(), rng.nextFloat(), rng.nextFloat());
    result.push_back({Vec3f(0.05f) + u * Vec3f(3.9f, 1.9f, 1.9f), normal, -normal});
  }
  return result;
}

const Box3f kBox{Vec3f(0.25f, 0.25f, 0.3f), Vec3f(3.75f, 1.75f, 1.7f)};
const Vec3i kProbes(5, 3, 3);

// The field at points(), its scene and lattice scaled.
std::vector<Vec4f> scaledAnswers(GpuContext& gpu, const std::string& preset, float scale) {
  const auto map = [scale](const Vec3f& p) { return p * scale; };
  const FieldScene scene(mapped(test::randomRoom(40), map, scale * scale, false));
  Params params = exactParams(preset);
  params.rays = 128;
  params.relocation = preset == "probelab" ? 1 : 0;
  const auto field = scene.field(
      gpu, boxLayout({kBox.min * scale, kBox.max * scale}, kProbes, scene.scene.bounds), params);
  for (uint64_t u = 0; u < 3; ++u) field->update(u, {}, {});
  std::vector<QueryPoint> at = points(500);
  for (QueryPoint& p : at) p.position = p.position * scale;
  return field->query(at);
}

struct Difference {
  double largest = 0, rms = 0;  // over the largest, and over the rms value
};
Difference difference(const std::vector<Vec4f>& a, const std::vector<Vec4f>& b) {
  double most = 0, top = 0, sum = 0, norm = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Vec3d va(Vec3f(a[i].x, a[i].y, a[i].z)), vb(Vec3f(b[i].x, b[i].y, b[i].z));
    most = std::max(most, length(va - vb));
    top = std::max(top, length(va));
    sum += dot(va - vb, va - vb);
    norm += dot(va, va);
  }
  return {most / top, std::sqrt(sum / norm)};
}

class Scale : public GpuTest, public ::testing::WithParamInterface<const char*> {};

// By a power of two every number scales exactly; by others each is rounded anew.
TEST_P(Scale, UnitsDoNotMatter) {
  const std::vector<Vec4f> one = scaledAnswers(gpu(), GetParam(), 1);
  for (const float scale : {0x1p7f, 0x1p-7f}) {
    const Difference d = difference(one, scaledAnswers(gpu(), GetParam(), scale));
    EXPECT_LT(d.largest, 1e-6) << scale;
  }
  for (const float scale : {0.01f, 100.0f}) {
    const Difference d = difference(one, scaledAnswers(gpu(), GetParam(), scale));
    RecordProperty(scale < 1 ? "hundredth" : "hundred", std::to_string(d.rms * 1e6) + "e-6");
    EXPECT_LT(d.rms, 1e-4) << scale;
  }
}

INSTANTIATE_TEST_SUITE_P(Presets, Scale, ::testing::Values("rtxgi", "probelab"),
                         [](const auto& info) { return std::string(info.param); });

// The cornell box with its one node moved.
Scene cornellAt(double metres) {
  namespace fs = std::filesystem;
  const fs::path source = PROBELAB_SOURCE_DIR "/scenes/cornell";
  const fs::path folder = fs::path(testing::TempDir()) / ("cornell_at_" + std::to_string(metres));
  fs::create_directories(folder);
  fs::copy_file(source / "cornell.bin", folder / "cornell.bin",
                fs::copy_options::overwrite_existing);
  std::stringstream text;
  text << std::ifstream(source / "cornell.gltf").rdbuf();
  std::string gltf = text.str();
  const std::string node = "\"mesh\": 0";
  const std::size_t at = gltf.find(node);
  EXPECT_NE(at, std::string::npos);
  const std::string m = std::to_string(metres);
  gltf.insert(at + node.size(), ", \"translation\": [" + m + ", " + m + ", -" + m + "]");
  std::ofstream(folder / "cornell.gltf") << gltf;
  Scene scene = loadScene(folder / "cornell.gltf");
  fs::remove_all(folder);
  return scene;
}

TEST_F(Invariance, WhereASceneLiesDoesNotMatter) {
  const auto answers = [&](double metres) {
    const FieldScene scene(cornellAt(metres));
    EXPECT_GT(length(scene.scene.origin), metres);
    const Box3f& b = scene.scene.bounds;
    const Vec3f margin = b.extent() * 0.1f;
    Params params = exactParams("rtxgi");
    params.rays = 128;
    const auto field =
        scene.field(gpu(), boxLayout({b.min + margin, b.max - margin}, Vec3i(4, 4, 4), b), params);
    for (uint64_t u = 0; u < 3; ++u) field->update(u, {}, {});
    std::vector<QueryPoint> at = points(500);
    for (QueryPoint& p : at) p.position = b.min + (p.position / Vec3f(4, 2, 2)) * b.extent();
    return field->query(at);
  };
  const std::vector<Vec4f> here = answers(0);
  for (const double metres : {1e3, 1e5}) {
    const Difference d = difference(here, answers(metres));
    RecordProperty(metres < 1e4 ? "km_1" : "km_100", std::to_string(d.rms * 1e6) + "e-6");
    EXPECT_LT(d.rms, 1e-4) << metres;
  }
}

// Mean irradiance of points() for 16 sets of rays; the sets differ by seed or by rotation number.
std::array<double, 16> sampleMeans(GpuContext& gpu, const Scene& scene, const Box3f& box,
                                   const Vec3i& count, const Map& map, uint64_t seed) {
  const FieldScene fields(scene);
  Params params = exactParams("rtxgi");
  params.rays = 64;
  const auto field = fields.field(gpu, boxLayout(box, count, scene.bounds), params, {.seed = seed});
  std::vector<QueryPoint> at = points(400);
  for (QueryPoint& p : at) p = {map(p.position), map(p.normal), map(p.view)};
  std::array<double, 16> means{};
  for (uint64_t i = 0; i < means.size(); ++i) {
    for (uint64_t u = 0; u < 4; ++u) field->update(4 * i + u, {}, {});
    for (const Vec4f& e : field->query(at)) means[i] += static_cast<double>(e.y) / 400;
  }
  return means;
}

struct Estimate {
  double mean = 0, error = 0;
};
Estimate estimate(const std::array<double, 16>& samples) {
  double sum = 0, squares = 0;
  for (const double s : samples) sum += s, squares += s * s;
  const double mean = sum / 16;
  return {mean, std::sqrt((squares / 16 - mean * mean) / 15)};
}

// 16 independent sets of rays each: means agree within 4 standard errors of their difference. The
// octahedral map has an axis of its own (z), so a turn about y is another map of the same sky; what
// it changes of the mean must be below the noise as well.
TEST_F(Invariance, MirrorsTurnsAndSeedsAgreeWithinTheNoise) {
  const Scene scene = test::randomRoom(41);
  const Map same = [](const Vec3f& p) { return p; };
  const Map mirror = [](const Vec3f& p) { return Vec3f(-p.x, p.y, p.z); };
  const Map turn = [](const Vec3f& p) { return Vec3f(p.z, p.y, -p.x); };
  const Estimate base = estimate(sampleMeans(gpu(), scene, kBox, kProbes, same, 1));
  EXPECT_LT(base.error, 0.02 * base.mean);  // or the comparison says nothing
  const auto expectSame = [&](const char* what, const std::array<double, 16>& samples) {
    const Estimate other = estimate(samples);
    const double error = std::hypot(base.error, other.error);
    RecordProperty(what, std::to_string((other.mean - base.mean) / error));
    EXPECT_LT(std::abs(other.mean - base.mean), 4 * error) << what;
  };
  expectSame("seed", sampleMeans(gpu(), scene, kBox, kProbes, same, 2));
  expectSame("mirror", sampleMeans(gpu(), mapped(scene, mirror, 1, true),
                                   {Vec3f(-kBox.max.x, kBox.min.y, kBox.min.z),
                                    Vec3f(-kBox.min.x, kBox.max.y, kBox.max.z)},
                                   kProbes, mirror, 3));
  expectSame("turn", sampleMeans(gpu(), mapped(scene, turn, 1, false),
                                 {Vec3f(kBox.min.z, kBox.min.y, -kBox.max.x),
                                  Vec3f(kBox.max.z, kBox.max.y, -kBox.min.x)},
                                 Vec3i(kProbes.z, kProbes.y, kProbes.x), turn, 4));
}

}  // namespace
}  // namespace probelab
