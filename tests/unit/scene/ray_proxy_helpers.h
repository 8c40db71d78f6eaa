// SPDX-License-Identifier: GPL-3.0-or-later
// Shapes for the tests of ray proxies, and what is measured of them.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "scene/ray_proxy.h"
#include "scene_builders.h"

namespace probelab::test {

using Place = std::tuple<float, float, float>;
using Edge = std::pair<Place, Place>;

inline Place placeOf(const Vec3f& p) { return {p.x, p.y, p.z}; }

// Faces of a triangle at each edge, by position.
inline std::map<Edge, int> edgesOf(const Geometry& g, uint32_t material) {
  std::map<Edge, int> edges;
  for (const Triangle& t : g.triangles) {
    if (t.material != material) continue;
    for (int k = 0; k < 3; ++k) {
      const Place a = placeOf(g.positions[t.vertex[k]]);
      const Place b = placeOf(g.positions[t.vertex[(k + 1) % 3]]);
      ++edges[std::minmax(a, b)];
    }
  }
  return edges;
}

inline std::set<Edge> edgesWithFaces(const Geometry& g, uint32_t material, int faces) {
  std::set<Edge> result;
  for (const auto& [edge, count] : edgesOf(g, material))
    if (count == faces) result.insert(edge);
  return result;
}

inline Vec3d corner(const Geometry& g, std::size_t triangle, int k) {
  return Vec3d(g.positions[g.triangles[triangle].vertex[k]]);
}
inline Vec3d areaVector(const Geometry& g, std::size_t t) {
  const Vec3d a = corner(g, t, 0);
  return cross(corner(g, t, 1) - a, corner(g, t, 2) - a) * 0.5;
}
inline double areaOf(const Geometry& g) {
  double area = 0;
  for (std::size_t t = 0; t < g.triangles.size(); ++t) area += length(areaVector(g, t));
  return area;
}
inline double volumeOf(const Geometry& g) {  // divergence theorem; fronts outward
  double volume = 0;
  for (std::size_t t = 0; t < g.triangles.size(); ++t)
    volume += dot(areaVector(g, t), corner(g, t, 0)) / 3;
  return volume;
}

// Calls f(point, triangle, weights) at 10 places of every triangle.
inline void forPoints(const Geometry& g,
                      const std::function<void(const Vec3d&, std::size_t, const Vec3d&)>& f) {
  for (std::size_t t = 0; t < g.triangles.size(); ++t)
    for (int i = 0; i <= 3; ++i)
      for (int j = 0; i + j <= 3; ++j) {
        const Vec3d w(i / 3.0, j / 3.0, (3 - i - j) / 3.0);
        f(corner(g, t, 0) * w.x + corner(g, t, 1) * w.y + corner(g, t, 2) * w.z, t, w);
      }
}

// A closed box, fronts outward; the sheets meet in bitwise equal positions.
inline void addBox(SceneBuilder& builder, int n, uint32_t m, const Vec3f& size) {
  for (const float side : {0.0f, 1.0f})
    for (int axis = 0; axis < 3; ++axis)
      addSheet(builder, n, m, [&](float u, float v) {
        if (side == 0) std::swap(u, v);
        Vec3f p;
        p[axis] = side, p[(axis + 1) % 3] = u, p[(axis + 2) % 3] = v;
        return p * size;
      });
}

inline void oneMesh(SceneBuilder& builder, const std::string& name) {
  Geometry& g = builder.geometry();
  uint32_t first = 0;
  for (const MeshRange& range : g.meshes) first += range.triangle_count;
  g.meshes.push_back({name, first, static_cast<uint32_t>(g.triangles.size()) - first});
}

inline RayProxy proxyOf(const Scene& scene, double max_error_m) {
  RayProxyOptions options;
  options.max_error_m = max_error_m;
  options.max_edge_share = std::numeric_limits<double>::infinity();
  return makeRayProxy(scene, options);
}

inline void expectSound(const Scene& scene, const RayProxy& proxy) {
  const Geometry& before = *scene.geometry;
  const Geometry& after = *proxy.scene.geometry;
  EXPECT_LE(after.triangles.size(), before.triangles.size());
  EXPECT_EQ(proxy.report.triangles_before, before.triangles.size());
  EXPECT_EQ(proxy.report.triangles_after, after.triangles.size());
  for (const Triangle& t : after.triangles) {
    for (const uint32_t v : t.vertex) ASSERT_LT(v, after.positions.size());
    ASSERT_LT(t.material, proxy.scene.materials.size());
  }
  for (const auto* attribute : {&after.uv0, &after.uv1})
    if (!attribute->empty()) EXPECT_EQ(attribute->size(), after.positions.size());
  if (!after.normals.empty()) EXPECT_EQ(after.normals.size(), after.positions.size());
  EXPECT_LE(proxy.report.original_to_proxy_m, proxy.report.max_error_m * 1.000001 + 1e-6);
  EXPECT_LE(proxy.report.proxy_to_original_m, proxy.report.max_error_m * 1.000001 + 1e-6);
}

}  // namespace probelab::test
