// SPDX-License-Identifier: GPL-3.0-or-later
// Ray queries against a loop over all triangles in double precision.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "base/error.h"
#include "base/rng.h"
#include "gpu/acceleration_structure.h"
#include "gpu/commands.h"
#include "gpu_fixture.h"
#include "shared/ray.h"

namespace probelab {
namespace {

// Non-opaque candidates are accepted or not by the push constant.
constexpr const char* kClosest = R"(#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "shared/ray.h"
layout(local_size_x = 64) in;
layout(scalar, set = 0, binding = 0) readonly buffer Rays { Ray rays[]; };
layout(scalar, set = 0, binding = 1) writeonly buffer Hits { Hit hits[]; };
layout(scalar, set = 0, binding = 2) readonly buffer First { uint first_triangle[]; };
layout(set = 0, binding = 3) uniform accelerationStructureEXT scene;
layout(push_constant, scalar) uniform Push { uint count; uint accept_candidates; };
void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= count) return;
  Ray ray = rays[i];
  rayQueryEXT query;
  rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xff, ray.origin, ray.t_min,
                        ray.direction, ray.t_max);
  while (rayQueryProceedEXT(query))
    if (accept_candidates != 0) rayQueryConfirmIntersectionEXT(query);
  Hit hit = Hit(ray.t_max, kNoHit, 0, 0);
  if (rayQueryGetIntersectionTypeEXT(query, true) ==
      gl_RayQueryCommittedIntersectionTriangleEXT) {
    hit.t = rayQueryGetIntersectionTEXT(query, true);
    hit.primitive = first_triangle[rayQueryGetIntersectionGeometryIndexEXT(query, true)] +
                    rayQueryGetIntersectionPrimitiveIndexEXT(query, true);
    vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, true);
    hit.u = uv.x;
    hit.v = uv.y;
  }
  hits[i] = hit;
})";

struct Push {
  std::uint32_t count, accept_candidates;
};

struct Soup {
  std::vector<Vec3f> positions;
  std::vector<std::uint32_t> indices;
};

Vec3f randomPoint(Rng& rng, float extent) {
  const float x = rng.nextFloat(), y = rng.nextFloat(), z = rng.nextFloat();
  return (Vec3f(x, y, z) - Vec3f(0.5f)) * (2 * extent);
}

// Triangles of about a metre in a box of 10 m, their vertices in random order in the array.
Soup randomSoup(std::uint32_t triangles) {
  Rng rng(1, RngStream::test);
  Soup soup;
  for (std::uint32_t i = 0; i < triangles; ++i) {
    const Vec3f center = randomPoint(rng, 5);
    for (int k = 0; k < 3; ++k) soup.positions.push_back(center + randomPoint(rng, 1));
    for (std::uint32_t k = 0; k < 3; ++k) soup.indices.push_back(3 * i + (k + i) % 3);
  }
  return soup;
}

std::vector<Ray> randomRays(std::size_t count) {
  Rng rng(2, RngStream::test);
  std::vector<Ray> rays;
  while (rays.size() < count) {
    const Vec3f origin = randomPoint(rng, 6);
    const Vec3f direction = randomPoint(rng, 1);
    if (length(direction) < 0.1f) continue;
    const float t_min = rays.size() % 3 == 0 ? 2.0f : 0.0f;
    const float t_max = rays.size() % 5 == 0 ? 4.0f : 1e30f;
    rays.push_back({origin, t_min, normalize(direction), t_max});
  }
  return rays;
}

struct Expected {
  Hit hit;
  bool ambiguous = false;  // too close to an edge, an end of the ray or a second hit for floats
};

// Moeller, Trumbore 1997, in double.
void intersect(const Soup& soup, std::uint32_t triangle, const Ray& ray, double& closest,
               Expected& expected) {
  const auto corner = [&](int k) { return Vec3d(soup.positions[soup.indices[3 * triangle + k]]); };
  const Vec3d origin(ray.origin), direction(ray.direction);
  const Vec3d e1 = corner(1) - corner(0), e2 = corner(2) - corner(0);
  const Vec3d p = cross(direction, e2);
  const double det = dot(e1, p);
  const Vec3d s = origin - corner(0);
  const Vec3d q = cross(s, e1);
  const double u = dot(s, p) / det, v = dot(direction, q) / det, t = dot(e2, q) / det;
  // Float rounding moves a hit by about 10 m x 2^-23 / cosine; 1e-4 m is some 100 times that, and
  // triangles seen at a cosine below 0.02 are left out.
  constexpr double margin = 1e-4;
  const double inside = std::min({u, v, 1 - u - v});
  if (!(inside > -margin) || t < ray.t_min - margin || t > ray.t_max + margin) return;
  const double cosine = std::abs(det) / length(cross(e1, e2));
  const bool certain = inside > margin && t > ray.t_min + margin && t < ray.t_max - margin &&
                       cosine > 0.02 && std::abs(t - closest) > margin;
  if (t < closest + margin) expected.ambiguous = !certain;
  if (t >= closest || !certain) return;
  closest = t;
  expected.hit = {static_cast<float>(t), triangle, static_cast<float>(u), static_cast<float>(v)};
}

Expected closestHit(const Soup& soup, const Ray& ray, std::span<const std::uint8_t> visible) {
  Expected expected{{ray.t_max, kNoHit, 0, 0}, false};
  double closest = ray.t_max;
  bool ambiguous = false;
  for (std::uint32_t i = 0; i < soup.indices.size() / 3; ++i) {
    if (!visible.empty() && !visible[i]) continue;
    expected.ambiguous = false;
    intersect(soup, i, ray, closest, expected);
    ambiguous = ambiguous || expected.ambiguous;
  }
  expected.ambiguous = ambiguous;
  return expected;
}

class RayQueryTest : public GpuMemoryModeTest {
 protected:
  void SetUp() override {
    GpuMemoryModeTest::SetUp();
    if (IsSkipped()) return;
    if (!gpu().info().ray_query) GTEST_SKIP() << "the device has no ray queries";
  }

  std::vector<Hit> trace(const AccelerationStructure& scene, const std::vector<Ray>& rays,
                         bool accept_candidates) {
    const ComputePipeline shader =
        createPipeline(gpu(), {"closest.comp.glsl", {}, kClosest}, {3, true, sizeof(Push)});
    const GpuBuffer ray_buffer = createBufferFrom(gpu(), rays, MemoryUse::device, "rays");
    const GpuBuffer hits =
        createBuffer(gpu(), rays.size() * sizeof(Hit), MemoryUse::device, "hits");
    Commands commands(gpu());
    commands.begin();
    const auto count = static_cast<std::uint32_t>(rays.size());
    commands.dispatch(shader, {&ray_buffer, &hits, &scene.firstTriangles()}, &scene,
                      pushBytes(Push{count, accept_candidates}), groupCount(count, 64));
    commands.submitAndWait();
    return downloadArray<Hit>(gpu(), hits);
  }

  // `visible`: triangles that count; empty for all.
  void expectTruth(const Soup& soup, const std::vector<Ray>& rays, const std::vector<Hit>& hits,
                   std::span<const std::uint8_t> visible) {
    int ambiguous = 0, found = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Expected expected = closestHit(soup, rays[i], visible);
      ambiguous += expected.ambiguous;
      if (expected.ambiguous) continue;
      ASSERT_EQ(hits[i].primitive, expected.hit.primitive) << "ray " << i;
      if (expected.hit.primitive == kNoHit) continue;
      ++found;
      // The margin above; barycentric coordinates are lengths over edges of about 1 m.
      EXPECT_NEAR(hits[i].t, expected.hit.t, 1e-4f) << "ray " << i;
      EXPECT_NEAR(hits[i].u, expected.hit.u, 1e-3f) << "ray " << i;
      EXPECT_NEAR(hits[i].v, expected.hit.v, 1e-3f) << "ray " << i;
    }
    // The comparison is of something: of the box's rays every fifth or so meets a triangle.
    EXPECT_GT(found, static_cast<int>(rays.size()) / 10);
    EXPECT_LT(ambiguous, static_cast<int>(rays.size()) / 10);
  }
};
INSTANTIATE_TEST_SUITE_P(Memory, RayQueryTest, ::testing::Bool(), memoryModeName);

TEST_P(RayQueryTest, AgreesWithALoopOverAllTriangles) {
  const Soup soup = randomSoup(300);
  const std::vector<Ray> rays = randomRays(3000);
  const AccelerationStructure scene =
      buildAccelerationStructure(gpu(), soup.positions, soup.indices);
  EXPECT_EQ(scene.geometryCount(), 1u);
  EXPECT_GT(scene.bytes(), 0u);
  expectTruth(soup, rays, trace(scene, rays, false), {});
}

TEST_P(RayQueryTest, RunsOfOpacityKeepTheTrianglesIndices) {
  const Soup soup = randomSoup(300);
  const std::vector<Ray> rays = randomRays(3000);
  std::vector<std::uint8_t> opaque(300);
  for (std::size_t i = 0; i < opaque.size(); ++i) opaque[i] = (i / 7) % 2 == 0 || i % 11 == 0;
  const AccelerationStructure scene =
      buildAccelerationStructure(gpu(), soup.positions, soup.indices, opaque);
  EXPECT_GT(scene.geometryCount(), 40u);
  expectTruth(soup, rays, trace(scene, rays, true), {});
  expectTruth(soup, rays, trace(scene, rays, false), opaque);
}

TEST_P(RayQueryTest, VeryManyRunsBecomeOneGeometryOfCandidates) {
  const Soup soup = randomSoup(5000);
  std::vector<std::uint8_t> opaque(5000);
  for (std::size_t i = 0; i < opaque.size(); ++i) opaque[i] = i % 2;
  const std::vector<Ray> rays = randomRays(100);
  const AccelerationStructure scene =
      buildAccelerationStructure(gpu(), soup.positions, soup.indices, opaque);
  EXPECT_EQ(scene.geometryCount(), 1u);
  expectTruth(soup, rays, trace(scene, rays, true), {});
  for (const Hit& hit : trace(scene, rays, false)) EXPECT_EQ(hit.primitive, kNoHit);
}

TEST_P(RayQueryTest, WithoutTrianglesEveryRayMisses) {
  const AccelerationStructure scene = buildAccelerationStructure(gpu(), {}, {});
  const std::vector<Ray> rays = randomRays(100);
  for (const Hit& hit : trace(scene, rays, true)) EXPECT_EQ(hit.primitive, kNoHit);
}

TEST_P(RayQueryTest, WithoutTheExtensionThereIsAnErrorThatNamesIt) {
  DeviceOptions options = testDeviceOptions();
  options.ray_query = false;
  GpuContext context(options);
  try {
    buildAccelerationStructure(context, {}, {});
    FAIL() << "no error";
  } catch (const DeviceError& error) {
    EXPECT_NE(std::string(error.what()).find("VK_KHR_ray_query"), std::string::npos);
  }
  EXPECT_THROW(createPipeline(context, {"closest.comp.glsl", {}, kClosest}, {3, true, 8}),
               DeviceError);
  expectNoValidationMessages(context);
}

}  // namespace
}  // namespace probelab
