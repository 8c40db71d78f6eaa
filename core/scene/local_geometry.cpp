// SPDX-License-Identifier: Apache-2.0
// World geometry in double -> the scene's Geometry in single precision.
#include <cmath>

#include "gltf_geometry.h"

namespace probelab {
namespace {

template <class T>
Vec3<T> doubleArea(const std::vector<Vec3<T>>& positions, const Triangle& t) {
  const Vec3<T>& a = positions[t.vertex[0]];
  return cross(positions[t.vertex[1]] - a, positions[t.vertex[2]] - a);
}

// Whether a normal can be computed in single precision, as every renderer does.
bool hasArea(const std::vector<Vec3f>& positions, const Triangle& t) {
  const Vec3f n = doubleArea(positions, t);
  return dot(n, n) > 0;
}

// Removes triangles without area and shortens the meshes' runs.
void dropDegenerate(const std::string& file, Geometry& g, Warnings& warnings) {
  std::vector<Triangle> kept;
  kept.reserve(g.triangles.size());
  std::string first;
  for (MeshRange& mesh : g.meshes) {
    const auto begin = static_cast<uint32_t>(kept.size());
    const uint32_t end = mesh.first_triangle + mesh.triangle_count;
    for (uint32_t i = mesh.first_triangle; i < end; ++i)
      if (hasArea(g.positions, g.triangles[i])) kept.push_back(g.triangles[i]);
    const auto count = static_cast<uint32_t>(kept.size()) - begin;
    if (count != mesh.triangle_count && first.empty()) first = mesh.name;
    mesh.first_triangle = begin;
    mesh.triangle_count = count;
  }
  g.dropped_degenerate = static_cast<uint32_t>(g.triangles.size() - kept.size());
  if (g.dropped_degenerate > 0)
    warnings.add("{}: {} triangle{} of zero area left out (the first in {})", file,
                 g.dropped_degenerate, g.dropped_degenerate == 1 ? "" : "s", first);
  g.triangles = std::move(kept);
}

// A shading normal that looks away from its faces (their area-weighted sum) is turned round.
void turnNormals(const std::string& file, Geometry& g, Warnings& warnings) {
  if (g.normals.empty()) return;
  std::vector<Vec3d> faces(g.positions.size());
  for (const Triangle& t : g.triangles) {
    const Vec3d area(doubleArea(g.positions, t));
    for (const uint32_t v : t.vertex) faces[v] += area;
  }
  std::size_t turned = 0;
  for (std::size_t i = 0; i < faces.size(); ++i)
    if (dot(faces[i], Vec3d(g.normals[i])) < 0) g.normals[i] = -g.normals[i], ++turned;
  if (turned > 0)
    warnings.add("{}: {} shading normals looked away from their faces and were turned", file,
                 turned);
}

}  // namespace

Box3d boxOf(const WorldGeometry& geometry) {
  Box3d box;
  for (const Triangle& t : geometry.triangles) {
    const Vec3d n = doubleArea(geometry.positions, t);
    if (!(dot(n, n) > 0)) continue;
    for (const uint32_t v : t.vertex) box.extend(geometry.positions[v]);
  }
  return box;
}

std::shared_ptr<const Geometry> localGeometry(const std::string& file, WorldGeometry world,
                                              const Vec3d& origin, Warnings& warnings) {
  auto g = std::make_shared<Geometry>();
  g->positions.reserve(world.positions.size());
  for (const Vec3d& p : world.positions) g->positions.push_back(Vec3f(p - origin));
  g->normals = std::move(world.normals);
  g->uv0 = std::move(world.uv0);
  g->uv1 = std::move(world.uv1);
  g->triangles = std::move(world.triangles);
  g->meshes = std::move(world.meshes);
  dropDegenerate(file, *g, warnings);
  turnNormals(file, *g, warnings);
  for (const Triangle& t : g->triangles)
    for (const uint32_t v : t.vertex) g->box.extend(g->positions[v]);
  return g;
}

}  // namespace probelab
