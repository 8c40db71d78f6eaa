// SPDX-License-Identifier: GPL-3.0-or-later
// The query with traced visibility against weights worked out by hand.
#include "tuning/exact_visibility.h"

#include <gtest/gtest.h>

#include <numbers>

#include "base/error.h"
#include "scattered_helpers.h"
#include "scene_builders.h"

namespace probelab {
namespace {

constexpr double kPi = std::numbers::pi;

// Linear averages of bare interpolation weights.
Params bareParams(const std::vector<std::string>& changes = {}) {
  Params params = loadParams("rtxgi");
  for (const char* change :
       {"encoding_gamma=1.0", "normal_bias=0.0", "view_bias=0.0", "facing=none", "trilinear=plain",
        "crush=none", "average=linear", "fallback=none", "visibility_floor=0.3"})
    setParam(params, change);
  for (const std::string& change : changes) setParam(params, change);
  return params;
}

// Probes at the corners of [-1, 1]^3, radiance 1 where x < 0 and 3 where x > 0. No moments: nothing
// may read them.
FieldSnapshot twoSides(const Params& params, bool scattered) {
  const Lattice lattice{Vec3f(-1), Vec3f(2), Vec3i(2, 2, 2)};
  ProbeLayout layout =
      latticeLayout(lattice, {Vec3f(-4), Vec3f(4)}, std::vector<uint8_t>(8, uint8_t{1}));
  if (scattered) layout = test::latticeAsScattered(layout);
  FieldSnapshot field = layoutSnapshot(layout, initialStates(layout), params);
  const int side = field.lattice.irradiance_texels + 2 * field.lattice.border;
  for (const Vec3f& p : field.positions)
    field.irradiance.insert(field.irradiance.end(), static_cast<std::size_t>(side * side),
                            p.x < 0 ? Vec3f(1) : Vec3f(3));
  return field;
}

// A wall in the plane x = 0, and where `cage` is set a small closed box around the point.
Scene wallScene(bool wall, bool cage) {
  test::SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  if (wall) builder.quad(Vec3f(0, -3, -3), Vec3f(0, -3, 3), Vec3f(0, 3, 3), Vec3f(0, 3, -3), m);
  if (cage) builder.box(Vec3f(-0.6f, -0.1f, -0.1f), Vec3f(-0.4f, 0.1f, 0.1f), m, true);
  builder.box(Vec3f(-3.5f), Vec3f(3.5f), m, true);
  return builder.finish();
}

double exact(const std::vector<std::string>& changes, bool scattered, const Scene& scene,
             const QueryPoint& point) {
  const Params params = bareParams(changes);
  const EmbreeScene embree(scene);
  return static_cast<double>(
      queryExactVisibility(twoSides(params, scattered), params, {&point, 1}, embree)[0].x);
}

const QueryPoint kLeft{Vec3f(-0.5f, 0, 0), Vec3f(0, 1, 0), Vec3f(0, -1, 0)};
// Three quarters of the way to the left probes: 0.75 * 1 + 0.25 * 3. Weights of scattered probes
// are bytes: 1 / 255 of the difference of the values.
constexpr double kOpen = 1.5 * kPi;
double tolerance(bool scattered) { return scattered ? 2 * kPi / 255 : 1e-6; }

TEST(ExactVisibility, ProbesBehindAWallHaveNoWeight) {
  for (const bool scattered : {false, true}) {
    EXPECT_NEAR(exact({}, scattered, wallScene(false, false), kLeft), kOpen, tolerance(scattered));
    for (const char* crush : {"crush=none", "crush=after_trilinear", "crush=before_trilinear"})
      EXPECT_NEAR(exact({crush}, scattered, wallScene(true, false), kLeft), kPi, 1e-5) << crush;
  }
}

TEST(ExactVisibility, ItIsOnWhereTheParametersHaveNone) {
  EXPECT_NEAR(exact({"visibility=false"}, false, wallScene(true, false), kLeft), kPi, 1e-6);
}

TEST(ExactVisibility, APointOnTheWallSeesTheSideOfItsNormal) {
  const Scene scene = wallScene(true, false);
  for (const bool scattered : {false, true})
    for (const float side : {-1.0f, 1.0f}) {
      const QueryPoint point{Vec3f(0, 0.3f, -0.2f), Vec3f(side, 0, 0), Vec3f(-side, 0, 0)};
      EXPECT_NEAR(exact({}, scattered, scene, point), side < 0 ? kPi : 3 * kPi, 1e-5);
    }
}

// Where no probe is seen: nothing, or the cell without visibility; and `crush` leaves all of them
// the same share.
TEST(ExactVisibility, FallbacksAnswerAsAtRunTime) {
  const Scene caged = wallScene(false, true);
  for (const bool scattered : {false, true}) {
    const double tol = tolerance(scattered);
    EXPECT_EQ(exact({}, scattered, caged, kLeft), 0);
    EXPECT_NEAR(exact({"fallback=lerp_unoccluded"}, scattered, caged, kLeft), kOpen, tol);
    EXPECT_NEAR(exact({"fallback=nearest"}, scattered, caged, kLeft), kOpen, tol);
    EXPECT_NEAR(exact({"crush=before_trilinear"}, scattered, caged, kLeft), kOpen, tol);
  }
}

TEST(ExactVisibility, AConstantFieldIsReproduced) {
  const Box3f bounds{Vec3f(-3.4f), Vec3f(3.4f)};
  const Scene scene = wallScene(true, true);
  const EmbreeScene embree(scene);
  const std::vector<QueryPoint> points = test::randomQueries(bounds, 500, 3);
  Params params = loadParams("rtxgi");
  setParam(params, "encoding_gamma=1.0");
  setParam(params, "fallback=nearest");
  for (const bool scattered : {false, true}) {
    const ProbeLayout layout = scattered
                                   ? test::randomScattered(bounds, 40, Vec3i(5, 4, 6), bounds, 2)
                                   : latticeLayout(makeLattice(bounds, Vec3i(4, 3, 5)), bounds,
                                                   std::vector<uint8_t>(60, uint8_t{1}));
    FieldSnapshot field = layoutSnapshot(layout, initialStates(layout), params);
    const int side = field.lattice.irradiance_texels + 2 * field.lattice.border;
    field.irradiance.assign(field.positions.size() * static_cast<std::size_t>(side * side),
                            Vec3f(0.7f));
    for (const Vec3f& e : queryExactVisibility(field, params, points, embree))
      EXPECT_NEAR(static_cast<double>(e.y), 0.7 * kPi, 1e-6 * kPi);  // fp32
  }
}

TEST(ExactVisibility, AnotherFieldsParametersAreRefused) {
  const Scene scene = wallScene(false, false);
  const EmbreeScene embree(scene);
  const FieldSnapshot field = twoSides(bareParams(), false);
  for (const char* change : {"fallback=nearest", "irradiance_texels=10", "border=false"})
    EXPECT_THROW(queryExactVisibility(field, bareParams({change}), {&kLeft, 1}, embree), InputError)
        << change;
}

}  // namespace
}  // namespace probelab
