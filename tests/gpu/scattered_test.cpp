// SPDX-License-Identifier: GPL-3.0-or-later
// Fields of scattered probes on the device: the query against C++, updates against plain formulas,
// what they cost.
#include "scattered_helpers.h"
#include "update_oracle.h"

namespace probelab {
namespace {

using test::exactParams;
using test::FieldScene;
using test::randomQueries;
using test::randomScattered;

const Box3f kInside{Vec3f(0.2f), Vec3f(3.8f, 1.8f, 1.8f)};

ProbeLayout roomLayout(const Scene& scene, int probes = 40, uint64_t seed = 1) {
  return randomScattered(kInside, probes, Vec3i(9, 5, 6), scene.bounds, seed);
}

Vec3d rgb(const Vec4f& v) { return Vec3d(Vec3f(v.x, v.y, v.z)); }

double largestAnswer(const FieldSnapshot& snapshot, double gamma) {
  double largest = 0;
  for (const Vec3f& texel : snapshot.irradiance)
    largest = std::max(largest, static_cast<double>(maxComponent(texel)));
  return std::numbers::pi * std::pow(largest, gamma);
}

struct QueryCase {
  std::string name, preset;
  int fallback = -1, classification = PL_CLASSIFY_NONE;
  double parallax = 0;
  bool walls = false;
};
class ScatteredQueries : public GpuTest, public ::testing::WithParamInterface<QueryCase> {};

// The layout with a plane through every third voxel, whose back reads the corners of the next one.
ProbeLayout dividedLayout(const Scene& scene) {
  ProbeLayout layout = roomLayout(scene);
  InfluenceGrid& grid = layout.influence;
  const std::size_t voxels = grid.nearest.size();
  Rng rng(8, RngStream::test);
  grid.pieces.plane_of_voxel.assign(voxels, -1);
  for (std::size_t v = 0; v + 1 < voxels; v += 3) {
    grid.pieces.plane_of_voxel[v] = static_cast<int32_t>(grid.pieces.planes.size());
    const Vec3f n = test::randomUnit(rng);
    const Vec3f corner = grid.corners.position(static_cast<int>(voxelCorner(grid.corners, v, 0)));
    const Vec3f middle = corner + grid.corners.spacing * 0.5f - grid.corners.first;
    grid.pieces.planes.emplace_back(n.x, n.y, n.z, -dot(n, middle));
    for (uint32_t e = grid.voxel_begin[v + 1]; e < grid.voxel_begin[v + 2]; ++e)
      grid.entries.push_back(InfluenceEntry(grid.entries[e]));
    grid.voxel_begin.push_back(static_cast<uint32_t>(grid.entries.size()));
    grid.nearest.push_back(grid.nearest[v + 1]);
  }
  return layout;
}

TEST_P(ScatteredQueries, DeviceEqualsHost) {
  const FieldScene scene(test::randomRoom(40));
  Params params = exactParams(GetParam().preset);
  params.rays = 64;
  params.classification = GetParam().classification;
  if (GetParam().fallback >= 0) params.fallback = GetParam().fallback;
  params.parallax = GetParam().parallax;
  const auto field = scene.field(
      gpu(), GetParam().walls ? dividedLayout(scene.scene) : roomLayout(scene.scene), params);
  EXPECT_EQ(field->states().activeCount() < 40, params.classification != PL_CLASSIFY_NONE);
  for (uint64_t u = 0; u < 2; ++u) field->update(u, {}, {});
  const FieldSnapshot snapshot = takeSnapshot(*field);
  const std::vector<QueryPoint> points =
      randomQueries({Vec3f(-0.5f), Vec3f(4.5f, 2.5f, 2.5f)}, 4000, 2);
  const std::vector<Vec4f> device = field->query(points);
  const double tolerance = 1e-4 * largestAnswer(snapshot, params.encoding_gamma);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto host = querySnapshot<double>(snapshot, snapshot.params, points[i]);
    ASSERT_LT(length(rgb(device[i]) - host.irradiance), tolerance) << "point " << i;
    ASSERT_EQ(device[i].w < 0, host.answer != PL_ANSWER_WEIGHED) << "point " << i;
  }
}

const QueryCase kQueries[] = {
    {"classic", "classic"},
    {"gdc2019", "gdc2019"},
    {"majercik2021", "majercik2021"},
    {"rtxgi", "rtxgi"},
    {"probelab", "probelab"},
    {"asleep_none", "rtxgi", PL_FALLBACK_NONE, PL_CLASSIFY_INSIDE},
    {"asleep_lerp", "rtxgi", PL_FALLBACK_LERP_UNOCCLUDED, PL_CLASSIFY_INSIDE},
    {"asleep_nearest", "probelab", PL_FALLBACK_NEAREST, PL_CLASSIFY_INSIDE},
    {"parallax", "probelab", -1, PL_CLASSIFY_NONE, 1},
    {"walls", "probelab", -1, PL_CLASSIFY_NONE, 0, true},
    {"walls_asleep", "probelab", PL_FALLBACK_NEAREST, PL_CLASSIFY_INSIDE, 1, true},
};
INSTANTIATE_TEST_SUITE_P(Presets, ScatteredQueries, ::testing::ValuesIn(kQueries),
                         [](const auto& info) { return info.param.name; });

class Scattered : public GpuTest {};

// The device against the query written anew, not only against the shared text.
TEST_F(Scattered, TheQueryIsThePublishedOneWithLocalLengths) {
  const FieldScene scene(test::randomRoom(41));
  const Params params = exactParams("rtxgi");
  const ProbeLayout layout = roomLayout(scene.scene);
  const auto field = scene.field(gpu(), layout, params);
  for (uint64_t u = 0; u < 2; ++u) field->update(u, {}, {});
  const FieldSnapshot snapshot = takeSnapshot(*field);
  const std::vector<QueryPoint> points = randomQueries({Vec3f(0), Vec3f(4, 2, 2)}, 2000, 3);
  const std::vector<Vec4f> device = field->query(points);
  const double tolerance = 1e-4 * largestAnswer(snapshot, params.encoding_gamma);
  for (std::size_t i = 0; i < points.size(); ++i)
    ASSERT_LT(length(rgb(device[i]) - test::rtxgiByHand(layout, snapshot, params, points[i])),
              tolerance)
        << "point " << i;
}

class ScatteredUpdates : public GpuTest, public ::testing::WithParamInterface<const char*> {};

// From black, then with the bounce of the first and with hysteresis.
TEST_P(ScatteredUpdates, EqualTheFormulas) {
  const FieldScene scene(test::randomRoom(42));
  Params params = exactParams(GetParam());
  params.rays = 100;
  params.change_detector = PL_CHANGE_NONE;
  if (params.visibility != 0)
    params.classification = PL_CLASSIFY_INSIDE;  // some keep what they had
  params.flat_ray_share = 1;
  const auto field = scene.field(gpu(), roomLayout(scene.scene), params, {.seed = 5});
  const test::UpdateByHand by_hand(scene, *field);
  test::Texels texels = test::storedTexels(*field);
  for (const uint64_t update : {0, 1}) {
    const FieldSnapshot previous = takeSnapshot(*field);
    const float h = update == 0 ? 0.0f : 0.4f;
    field->update(update, {.hysteresis = h}, {.hysteresis = h});
    texels = by_hand.update(update, static_cast<double>(h), texels, &previous);
    test::expectTexels(*field, texels);
  }
}

INSTANTIATE_TEST_SUITE_P(Presets, ScatteredUpdates,
                         ::testing::Values("classic", "gdc2019", "rtxgi", "probelab"),
                         [](const auto& info) { return std::string(info.param); });

// A closed room whose walls all emit L = 1 and reflect half: E = pi L / (1 - 1/2) everywhere, also
// beside probes that are near a wall. Ray sums leave 1e-3 of it.
TEST_F(Scattered, FurnaceIsUniform) {
  const FieldScene scene(test::furnaceScene(0.5f, 1));
  Params params = exactParams("probelab");
  params.rays = 128;
  const ProbeLayout layout =
      randomScattered({Vec3f(0.1f), Vec3f(1.9f)}, 20, Vec3i(5, 5, 5), scene.scene.bounds, 4);
  const auto field = scene.field(gpu(), layout, params);
  convergeField(*field, {.average = 8});
  for (const Vec4f& e : field->query(randomQueries({Vec3f(0), Vec3f(2)}, 2000, 5)))
    ASSERT_NEAR(static_cast<double>(e.y) / (2 * std::numbers::pi), 1, 1e-3);
}

// A lattice's own points as corners: the same field by either query, whole updates included.
TEST_F(Scattered, PointsOfALatticeAsCornersGiveTheLatticesField) {
  const FieldScene scene(test::randomRoom(43));
  Params params = exactParams("rtxgi");
  params.rays = 128;
  params.trilinear_floor = 0;
  const ProbeLayout grid = test::boxLayout({Vec3f(0.25f), Vec3f(3.75f, 1.75f, 1.75f)},
                                           Vec3i(8, 4, 4), scene.scene.bounds);
  const std::vector<QueryPoint> points = randomQueries({Vec3f(0), Vec3f(4, 2, 2)}, 3000, 6);
  std::vector<Vec4f> answers[2];
  for (const int i : {0, 1}) {
    const auto field = scene.field(gpu(), i == 0 ? grid : test::latticeAsScattered(grid), params);
    for (uint64_t u = 0; u < 4; ++u) field->update(u, {}, {});
    answers[i] = field->query(points);
  }
  double largest = 0;
  for (const Vec4f& e : answers[0]) largest = std::max(largest, maxComponent(rgb(e)));
  for (std::size_t i = 0; i < points.size(); ++i)
    ASSERT_LT(length(rgb(answers[0][i]) - rgb(answers[1][i])), 1e-5 * largest) << "point " << i;
}

TEST_F(Scattered, WorkAndBytesAreThoseOfTheVoxels) {
  const FieldScene scene(test::furnaceScene(0.5f, 1));
  Params params = exactParams("rtxgi");
  params.classification = PL_CLASSIFY_NONE;
  const ProbeLayout layout =
      randomScattered({Vec3f(0.1f), Vec3f(1.9f)}, 20, Vec3i(3, 3, 3), scene.scene.bounds, 7);
  const auto field = scene.field(gpu(), layout, params);
  const std::size_t entries = layout.influence.entries.size();
  EXPECT_EQ(field->workOfUpdate().resolve_taps,
            20u * static_cast<uint64_t>(params.rays) * 8 * entries / 8);  // 8 fetches; 8 voxels
  EXPECT_EQ(indexBytes(layout), 9 * 4 + entries * 12);
  // Positions with s_i, and the clamp.
  const uint64_t nearest = params.fallback == PL_FALLBACK_NEAREST ? 8 * 4 : 0;
  EXPECT_EQ(field->stateBytes(), indexBytes(layout) + 20 * (16 + 4) + nearest);
}

}  // namespace
}  // namespace probelab
