// SPDX-License-Identifier: GPL-3.0-or-later
// The query in every state of its cell: the published weights in plain C++ of their own, moved
// probes, cells whose probes are occluded or inactive, and the counters of what was answered how.
#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "random_unit.h"
#include "update_oracle.h"

namespace probelab {
namespace {

using test::boxLayout;
using test::exactParams;
using test::FieldScene;
using test::randomUnit;
using test::SceneBuilder;

std::vector<QueryPoint> pointsIn(const Box3f& box, int n, uint64_t seed) {
  Rng rng(seed, RngStream::test, 4);
  std::vector<QueryPoint> points;
  for (int i = 0; i < n; ++i) {
    const Vec3f u(rng.nextFloat(), rng.nextFloat(), rng.nextFloat());
    points.push_back({box.min + u * box.extent(), randomUnit(rng), randomUnit(rng)});
  }
  return points;
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
  std::function<void(Params&)> change;
};
class QuerySwitches : public GpuTest, public ::testing::WithParamInterface<QueryCase> {};

// GLSL against the shared header in double, probes moved, asleep and in place.
TEST_P(QuerySwitches, DeviceEqualsHost) {
  const FieldScene scene(test::randomRoom(30));
  Params params = loadParams(GetParam().preset);
  params.rays = 64;
  GetParam().change(params);
  const auto field = scene.field(
      gpu(), boxLayout({Vec3f(0.2f), Vec3f(3.8f, 1.8f, 1.8f)}, Vec3i(6, 3, 3), scene.scene.bounds),
      params);
  for (uint64_t u = 0; u < 2; ++u) field->update(u, {}, {});
  const FieldSnapshot snapshot = takeSnapshot(*field);
  const Box3f around{scene.scene.bounds.min - Vec3f(0.3f), scene.scene.bounds.max + Vec3f(0.3f)};
  const std::vector<QueryPoint> points = pointsIn(around, 3000, 5);
  const std::vector<Vec4f> device = field->query(points);
  const double tolerance = 1e-4 * largestAnswer(snapshot, params.encoding_gamma);
  int differing = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto host = querySnapshot<double>(snapshot, snapshot.params, points[i]);
    if (length(rgb(device[i]) - host.irradiance) > tolerance) ++differing;
    if (GetParam().preset != "gdc2019") {
      EXPECT_EQ(device[i].w < 0, host.answer != PL_ANSWER_WEIGHED) << "point " << i;
    }
  }
  EXPECT_EQ(differing, 0);
}

const QueryCase kQueries[] = {
    {"probelab", "probelab", [](Params&) {}},
    {"majercik2021", "majercik2021", [](Params&) {}},
    {"gdc2019_borderless", "gdc2019", [](Params& p) { p.border = 0; }},
    {"rtxgi_central", "rtxgi",
     [](Params& p) { p.moment_encoding = PL_MOMENTS_CENTRAL, p.border = 0; }},
    {"rtxgi_moved", "rtxgi", [](Params& p) { p.relocation = 1, p.offset_weights = 1; }},
    {"probelab_moved_asleep", "probelab",
     [](Params& p) {
       p.relocation = 1, p.offset_weights = 1;
       p.classification = PL_CLASSIFY_NEAR_SURFACE;
     }},
    {"rtxgi_asleep_lerp", "rtxgi",
     [](Params& p) {
       p.classification = PL_CLASSIFY_INSIDE;
       p.fallback = PL_FALLBACK_LERP_UNOCCLUDED;
     }},
    {"odd_gammas", "rtxgi", [](Params& p) { p.encoding_gamma = 2.2, p.chebyshev_power = 2.5; }},
};
INSTANTIATE_TEST_SUITE_P(Queries, QuerySwitches, ::testing::ValuesIn(kQueries),
                         [](const auto& info) { return info.param.name; });

// Bilinear reading of a map of side x side texels with a border, in a direction.
template <class Value, class Texel>
Value readMap(const std::vector<Texel>& texels, int probe, int side, const Vec3d& direction) {
  const Vec2d e = octEncode(direction);
  const double u = (e.x + 1) / 2 * (side - 2) + 0.5, w = (e.y + 1) / 2 * (side - 2) + 0.5;
  const int x = std::min(static_cast<int>(u), side - 2);
  const int y = std::min(static_cast<int>(w), side - 2);
  const auto texel = [&](int i, int j) {
    return Value(texels[static_cast<std::size_t>((probe * side + j) * side + i)]);
  };
  const double fx = u - x, fy = w - y;
  return (texel(x, y) * (1 - fx) + texel(x + 1, y) * fx) * (1 - fy) +
         (texel(x, y + 1) * (1 - fx) + texel(x + 1, y + 1) * fx) * fy;
}

// The query of [RTXGI] as published, written anew: full lattice, raw moments in r_i.
class PublishedQuery {
 public:
  explicit PublishedQuery(ProbeField& field)
      : layout_(field.layout()),
        params_(field.params()),
        irradiance_(field.irradianceTexels()),
        moments_(field.momentTexels()) {}

  Vec3d operator()(const QueryPoint& q) const {
    const Vec3d x(q.position), n(q.normal), v(q.view), s(layout_.lattice.spacing);
    const double s_i = static_cast<double>(layout_.bias_length_m);
    const Vec3d biased = x + (n * params_.normal_bias - v * params_.view_bias) * s_i;
    const Vec3d at = (biased - Vec3d(layout_.lattice.first)) / s;
    int base[3];
    double alpha[3];
    for (std::size_t a = 0; a < 3; ++a) {
      base[a] = std::clamp(static_cast<int>(std::floor(at[a])), 0, layout_.lattice.count[a] - 2);
      alpha[a] = std::clamp(at[a] - base[a], 0.0, 1.0);
    }
    Vec3d sum;
    double weights = 0;
    for (int corner = 0; corner < 8; ++corner) {
      double trilinear = 1;
      int place[3];
      for (std::size_t a = 0; a < 3; ++a) {
        const int up = corner >> a & 1;
        place[a] = base[a] + up;
        trilinear *= std::max(0.001, up != 0 ? alpha[a] : 1 - alpha[a]);
      }
      const Vec3i count = layout_.lattice.count;
      const int probe = (place[2] * count.y + place[1]) * count.x + place[0];
      const Vec3d p(layout_.positions[static_cast<std::size_t>(probe)]);
      double weight = (dot(n, normalize(p - x)) + 1) / 2;
      weight = weight * weight + 0.2;
      const double distance = length(p - biased) / static_cast<double>(layout_.support_radius_m);
      weight = std::max(1e-6, weight * visibility(probe, biased - p, distance));
      if (weight < 0.2) weight = weight * weight * weight / 0.04;
      weight *= trilinear;
      sum += pow(readMap<Vec3d>(irradiance_, probe, params_.irradiance_texels, n), Vec3d(2.5)) *
             weight;
      weights += weight;
    }
    const Vec3d root = sum / weights;
    return root * root * std::numbers::pi;
  }

 private:
  double visibility(int probe, const Vec3d& away, double distance) const {
    const Vec2d m = readMap<Vec2d>(moments_, probe, params_.moment_texels, away);
    if (distance <= m.x) return 1;
    const double variance = std::abs(m.x * m.x - m.y);
    const double excess = distance - m.x;
    return std::max(0.05, std::pow(variance / (variance + excess * excess), 3));
  }

  const ProbeLayout& layout_;
  const Params& params_;
  std::vector<Vec3f> irradiance_;
  std::vector<Vec2f> moments_;
};

class Fallback : public GpuTest {};

TEST_F(Fallback, TheQueryIsThePublishedOne) {
  const FieldScene scene(test::randomRoom(31));
  const auto field = scene.field(
      gpu(), boxLayout({Vec3f(0.2f), Vec3f(3.8f, 1.8f, 1.8f)}, Vec3i(6, 3, 4), scene.scene.bounds),
      exactParams("rtxgi"));
  for (uint64_t u = 0; u < 2; ++u) field->update(u, {}, {});
  const PublishedQuery published(*field);
  const std::vector<QueryPoint> points = pointsIn({Vec3f(0), Vec3f(4, 2, 2)}, 2000, 6);
  const std::vector<Vec4f> device = field->query(points);
  const double largest = largestAnswer(takeSnapshot(*field), 5);
  for (std::size_t i = 0; i < points.size(); ++i)
    ASSERT_LT(length(rgb(device[i]) - published(points[i])), 1e-4 * largest) << "point " << i;
}

// Two rooms, a wall of 1 m between them; the probes of the middle columns lie within the wall and
// see back faces only. Left L = 1, right L = 2: uniform, so that an answer names its probes.
Scene twoRooms() {
  SceneBuilder builder;
  const uint32_t left = builder.material(Vec3f(0), Vec3f(1));
  const uint32_t right = builder.material(Vec3f(0), Vec3f(2));
  builder.box(Vec3f(0), Vec3f(2, 2, 2), left, true);
  builder.box(Vec3f(3, 0, 0), Vec3f(5, 2, 2), right, true);
  builder.scene().bounds = {Vec3f(0), Vec3f(5, 2, 2)};
  return builder.finish();
}

// Seven columns of probes at 0.25, 1, 1.75, 2.5, 3.25, 4, 4.75; only 2.5 lies in the wall.
ProbeLayout twoRoomsLayout(const Scene& scene) {
  return boxLayout({Vec3f(0.25f, 0.5f, 0.5f), Vec3f(4.75f, 1.5f, 1.5f)}, Vec3i(7, 2, 2),
                   scene.bounds);
}

Params asleep(int fallback) {
  Params params = exactParams("classic");
  params.rays = 64;
  params.classification = PL_CLASSIFY_INSIDE;
  params.fallback = fallback;
  return params;
}

QueryPoint at(float x, float y = 1) { return {Vec3f(x, y, 1), Vec3f(0, 1, 0), Vec3f(0, -1, 0)}; }

TEST_F(Fallback, InactiveProbesHaveNoPartInTheirCells) {
  const FieldScene scene(twoRooms());
  const auto field = scene.field(gpu(), twoRoomsLayout(scene.scene), asleep(PL_FALLBACK_NONE));
  EXPECT_EQ(field->states().activeCount(), 24u);
  field->update(0, {}, {});
  // Between 1.75 and 3.25 half of each cell is asleep; the other half answers alone.
  const std::vector<QueryPoint> points{at(1), at(2), at(2.4f), at(2.6f), at(4)};
  const double expected[] = {1, 1, 1, 2, 2};
  const std::vector<Vec4f> answers = field->query(points);
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_NEAR(answers[i].x, expected[i] * std::numbers::pi, 1e-4) << i;
  EXPECT_EQ(field->counters().fallback_queries, 0u);
}

// A wide wall: whole cells are asleep. Columns at 0.2 + 0.46 k; the wall spans 2 to 3.
ProbeLayout denseLayout(const Scene& scene) {
  return boxLayout({Vec3f(0.2f, 0.5f, 0.5f), Vec3f(4.8f, 1.5f, 1.5f)}, Vec3i(11, 2, 2),
                   scene.bounds);
}

TEST_F(Fallback, ACellWithoutActiveProbesAsksTheNearestAndIsCounted) {
  const FieldScene scene(twoRooms());
  const auto field = scene.field(gpu(), denseLayout(scene.scene), asleep(PL_FALLBACK_NEAREST));
  // Columns 4 (2.04), 5 (2.5) and 6 (2.96) lie in the wall: cells 4-5 and 5-6 have no active probe.
  ASSERT_EQ(field->states().activeCount(), 32u);
  field->update(0, {}, {});
  std::vector<QueryPoint> points;
  for (int i = 0; i < 100; ++i) points.push_back(at(2.1f + 0.008f * static_cast<float>(i)));
  const std::vector<Vec4f> answers = field->query(points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    // The nearest lattice point's nearest: 4 belongs to the left, 6 to the right; 5 is as far from
    // both and takes the smaller index.
    const double expected = points[i].position.x < 2.73f ? 1 : 2;
    EXPECT_NEAR(answers[i].x, expected * std::numbers::pi, 1e-4) << points[i].position.x;
    EXPECT_EQ(answers[i].w, -1.0f);
  }
  EXPECT_EQ(field->counters().nearest_answers, 100u);
  EXPECT_EQ(field->counters().unoccluded_answers, 0u);
  EXPECT_EQ(field->counters().empty_answers, 0u);
  EXPECT_EQ(field->counters().fallback_queries, 100u);
}

TEST_F(Fallback, WithoutFallbackACellWithoutProbesIsDarkAndCounted) {
  const FieldScene scene(twoRooms());
  for (const int fallback : {PL_FALLBACK_NONE, PL_FALLBACK_LERP_UNOCCLUDED}) {
    Params params = asleep(fallback);
    params.visibility = fallback == PL_FALLBACK_NONE ? 0 : 1;
    const auto field = scene.field(gpu(), denseLayout(scene.scene), params);
    field->update(0, {}, {});
    const std::vector<Vec4f> answers =
        field->query(std::vector<QueryPoint>{at(2.2f), at(1), at(2.8f)});
    EXPECT_EQ(rgb(answers[0]), Vec3d(0));
    EXPECT_EQ(rgb(answers[2]), Vec3d(0));
    EXPECT_GT(answers[1].x, 3);
    EXPECT_EQ(field->counters().empty_answers, 2u);
    EXPECT_EQ(field->counters().fallback_queries, 2u);
  }
}

// One probe in a closed box, all others too: outside, every probe of the cell is occluded. Moments
// without any variance (one ray) and no floor make all weights exactly 0.
TEST_F(Fallback, ACellWhereAllIsOccludedAnswersWithoutVisibilityAndIsCounted) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0), Vec3f(1));
  for (int i = 0; i < 8; ++i) {
    const Vec3f center(static_cast<float>(i & 1), static_cast<float>(i >> 1 & 1),
                       static_cast<float>(i >> 2));
    builder.box(center - Vec3f(0.1f), center + Vec3f(0.1f), m, true);
  }
  builder.scene().bounds = {Vec3f(0), Vec3f(1)};
  const FieldScene scene(builder.finish());
  for (const int fallback : {PL_FALLBACK_NONE, PL_FALLBACK_NEAREST}) {
    Params params = exactParams("rtxgi");
    params.moment_encoding = PL_MOMENTS_CENTRAL;
    params.rays = 1;
    params.normal_bias = params.view_bias = 0;
    params.visibility_floor = 0;
    params.crush = PL_CRUSH_NONE;
    params.chebyshev_power = 32;  // the variance that fp32 leaves, 2^-24, to this power is 0
    params.fallback = fallback;
    const auto field =
        scene.field(gpu(), boxLayout({Vec3f(0), Vec3f(1)}, Vec3i(2), scene.scene.bounds), params);
    field->update(0, {}, {});
    const std::vector<QueryPoint> points{
        {Vec3f(0.5f), Vec3f(0, 1, 0), Vec3f(0, -1, 0)},
        {Vec3f(0.6f, 0.4f, 0.5f), Vec3f(1, 0, 0), Vec3f(-1, 0, 0)}};
    for (const Vec4f& e : field->query(points)) {
      EXPECT_NEAR(e.x, fallback == PL_FALLBACK_NEAREST ? std::numbers::pi : 0, 1e-4);
      EXPECT_EQ(e.w, -1.0f);
    }
    const Counters counters = field->counters();
    EXPECT_EQ(counters.unoccluded_answers, fallback == PL_FALLBACK_NEAREST ? 2u : 0u);
    EXPECT_EQ(counters.empty_answers, fallback == PL_FALLBACK_NEAREST ? 0u : 2u);
    EXPECT_EQ(counters.fallback_queries, 2u);
    // A point that sees a probe is answered by weights and not counted.
    EXPECT_GT(field->query(std::vector<QueryPoint>{{Vec3f(0.02f), Vec3f(0, 1, 0), Vec3f(0, -1, 0)}})
                  .front()
                  .w,
              0);
    EXPECT_EQ(field->counters().fallback_queries, 2u);
  }
}

// No probe anywhere that is awake is an error of the input, not a dark field.
TEST_F(Fallback, AFieldWithoutActiveProbesIsRefused) {
  const FieldScene scene(twoRooms());
  const ProbeLayout layout =
      boxLayout({Vec3f(2.3f, 0.5f, 0.5f), Vec3f(2.7f, 1.5f, 1.5f)}, Vec3i(2), scene.scene.bounds);
  EXPECT_THROW(scene.field(gpu(), layout, asleep(PL_FALLBACK_NEAREST)), std::exception);
}

}  // namespace
}  // namespace probelab
