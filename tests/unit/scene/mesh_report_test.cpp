// SPDX-License-Identifier: GPL-3.0-or-later
// Edge counts of meshes small enough to count by hand.
#include "scene/mesh_report.h"

#include <memory>

#include "scene_files.h"

namespace probelab::test {
namespace {

using Corners = std::array<uint32_t, 3>;

Scene sceneOf(std::vector<Vec3f> positions, const std::vector<Corners>& triangles,
              std::vector<uint32_t> mesh_sizes = {}) {
  auto g = std::make_shared<Geometry>();
  g->positions = std::move(positions);
  for (const Corners& t : triangles) g->triangles.push_back({{t[0], t[1], t[2]}, 0});
  if (mesh_sizes.empty()) mesh_sizes = {static_cast<uint32_t>(triangles.size())};
  uint32_t first = 0;
  for (const uint32_t size : mesh_sizes) {
    g->meshes.push_back({"mesh " + std::to_string(first), first, size});
    first += size;
  }
  for (const Vec3f& p : g->positions) g->box.extend(p);
  Scene scene;
  scene.geometry = g;
  scene.materials.emplace_back();
  return scene;
}

const std::vector<Vec3f> kTetrahedron = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
const std::vector<Corners> kFaces = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};

TEST(MeshReport, AClosedTetrahedronHasNothingToReport) {
  const MeshReport report = reportMesh(sceneOf(kTetrahedron, kFaces));
  EXPECT_TRUE(report.all.closed());
  EXPECT_EQ(report.all.triangles, 4u);
  EXPECT_EQ(report.all.nonmanifold_edges, 0u);
  EXPECT_EQ(report.all.inconsistent_edges, 0u);
  EXPECT_EQ(report.welded_vertices, 4u);
  EXPECT_EQ(report.duplicate_triangles, 0u);
}

TEST(MeshReport, SplitVerticesAreWelded) {
  std::vector<Vec3f> positions;
  std::vector<Corners> triangles;
  for (const Corners& face : kFaces) {
    const auto n = static_cast<uint32_t>(positions.size());
    for (const uint32_t v : face) positions.push_back(kTetrahedron[v]);
    triangles.push_back({n, n + 1, n + 2});
  }
  const MeshReport report = reportMesh(sceneOf(positions, triangles));
  EXPECT_TRUE(report.all.closed());
  EXPECT_EQ(report.welded_vertices, 4u);
}

TEST(MeshReport, VerticesWithinTheWeldingDistanceAreOne) {
  // The box's diagonal is sqrt(3) of 1000 m: 1.73 mm. The offset crosses cells of that grid.
  for (const auto& [offset, welds] : {std::pair{1.5e-3f, true}, std::pair{2.5e-3f, false}}) {
    std::vector<Vec3f> positions = kTetrahedron;
    for (Vec3f& p : positions) p = p * 1000.0f;
    positions.push_back(Vec3f(offset, 0, 0));
    std::vector<Corners> faces = kFaces;
    faces[0] = {4, 2, 1};
    const MeshReport report = reportMesh(sceneOf(positions, faces));
    EXPECT_EQ(report.all.closed(), welds);
    EXPECT_EQ(report.welded_vertices, welds ? 4u : 5u);
  }
}

TEST(MeshReport, AnOpenFaceHasThreeBoundaryEdges) {
  const MeshReport report = reportMesh(sceneOf(kTetrahedron, {kFaces[0], kFaces[1], kFaces[2]}));
  EXPECT_FALSE(report.all.closed());
  EXPECT_EQ(report.all.boundary_edges, 3u);
}

TEST(MeshReport, AFlippedFaceIsInconsistentAlongItsThreeEdges) {
  std::vector<Corners> faces = kFaces;
  std::swap(faces[2][0], faces[2][1]);
  const MeshReport report = reportMesh(sceneOf(kTetrahedron, faces));
  EXPECT_TRUE(report.all.closed());
  EXPECT_EQ(report.all.inconsistent_edges, 3u);
}

TEST(MeshReport, AFinOnAnEdgeIsNonManifold) {
  std::vector<Vec3f> positions = kTetrahedron;
  positions.push_back({2, 2, 0});
  std::vector<Corners> faces = kFaces;
  faces.push_back({1, 2, 4});
  const MeshReport report = reportMesh(sceneOf(positions, faces, {4, 1}));
  EXPECT_EQ(report.all.nonmanifold_edges, 1u);  // 1-2
  EXPECT_EQ(report.all.boundary_edges, 2u);     // 2-4, 4-1
  ASSERT_EQ(report.meshes.size(), 2u);
  EXPECT_TRUE(report.meshes[0].closed());
  EXPECT_EQ(report.meshes[0].nonmanifold_edges, 0u);
  EXPECT_EQ(report.meshes[1].boundary_edges, 3u);
  EXPECT_EQ(report.meshes[1].name, "mesh 4");
}

TEST(MeshReport, TrianglesOnTheSameThreeVerticesAreDuplicates) {
  std::vector<Corners> faces = kFaces;
  faces.push_back({1, 0, 2});
  faces.push_back({1, 2, 0});
  EXPECT_EQ(reportMesh(sceneOf(kTetrahedron, faces)).duplicate_triangles, 2u);
}

TEST(MeshReport, ATriangleThatWeldingClosesLeavesItsNeighboursJoined) {
  // Vertex 4 is vertex 1 moved by less than the welding distance; the needle 1-4-2 fills the gap.
  std::vector<Vec3f> positions = kTetrahedron;
  positions.push_back(Vec3f(1, 0, 1e-7f));
  const std::vector<Corners> faces = {{0, 2, 1}, {0, 1, 3}, {4, 2, 3}, {0, 3, 2}, {1, 2, 4}};
  const MeshReport report = reportMesh(sceneOf(positions, faces));
  EXPECT_TRUE(report.all.closed());
  EXPECT_EQ(report.all.nonmanifold_edges, 0u);
  EXPECT_EQ(report.all.inconsistent_edges, 0u);
}

TEST(MeshReport, ASceneWithoutTrianglesIsEmpty) {
  const MeshReport report = reportMesh(Scene{});
  EXPECT_EQ(report.all.triangles, 0u);
  EXPECT_TRUE(report.meshes.empty());
}

}  // namespace
}  // namespace probelab::test
