// SPDX-License-Identifier: GPL-3.0-or-later
// Geometry of glTF files against positions worked out by hand. Positions pass through fp32 relative
// to the scene's centre: scenes of size 1 to 10 keep 1e-6.
#include <cmath>
#include <numbers>

#include "scene/load.h"
#include "scene_files.h"

namespace probelab::test {
namespace {

using nlohmann::json;

const std::vector<float> kQuad = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};

json primitiveOf(GltfBuilder& gltf, int positions) {
  return {{"attributes", {{"POSITION", positions}}}, {"material", gltf.material(matte())}};
}

Vec3d normalOf(const Scene& scene, std::size_t t) {
  return normalize(
      cross(corner(scene, t, 1) - corner(scene, t, 0), corner(scene, t, 2) - corner(scene, t, 0)));
}

TEST(GltfGeometry, TheSameFileLoadsAsGltfAndAsGlb) {
  GltfBuilder gltf;
  gltf.triangle({0, 0, 0, 2, 0, 0, 0, 3, 1});
  const TemporaryFolder folder;
  gltf.writeGltf(folder / "a.gltf");
  gltf.writeGlb(folder / "b.glb");
  const Scene a = loadScene(folder / "a.gltf"), b = loadScene(folder / "b.glb");
  EXPECT_TRUE(a.warnings.empty());
  for (const Scene* scene : {&a, &b}) {
    ASSERT_EQ(scene->geometry->triangles.size(), 1u);
    EXPECT_VEC_NEAR(corner(*scene, 0, 0), 0, 0, 0, 1e-6);
    EXPECT_VEC_NEAR(corner(*scene, 0, 1), 2, 0, 0, 1e-6);
    EXPECT_VEC_NEAR(corner(*scene, 0, 2), 0, 3, 1, 1e-6);
    EXPECT_VEC_NEAR(scene->origin, 1, 1.5, 0.5, 0);
    ASSERT_EQ(scene->states.size(), 1u);
    EXPECT_EQ(scene->state, "default");
  }
  EXPECT_NE(a.content_hash, b.content_hash);
}

TEST(GltfGeometry, DefaultBoundsAreTheBoxGrownByOnePercentOfItsDiagonal) {
  GltfBuilder gltf;
  gltf.triangle({0, 0, 0, 3, 0, 0, 0, 4, 0});  // flat, diagonal 5
  const Scene scene = loadGlb(gltf);
  EXPECT_VEC_NEAR(toWorld(scene, scene.bounds.min), -0.05, -0.05, -0.05, 1e-6);
  EXPECT_VEC_NEAR(toWorld(scene, scene.bounds.max), 3.05, 4.05, 0.05, 1e-6);
}

TEST(GltfGeometry, IndicesOfEveryWidthGiveTheSameTriangles) {
  for (const int type : {5121, 5123, 5125}) {
    GltfBuilder gltf;
    json primitive = primitiveOf(gltf, gltf.floats("VEC3", kQuad));
    primitive["indices"] = gltf.indices({0, 1, 2, 0, 2, 3}, type);
    gltf.node({{"mesh", gltf.mesh(primitive)}});
    const Scene scene = loadGlb(gltf);
    ASSERT_EQ(scene.geometry->triangles.size(), 2u) << type;
    EXPECT_VEC_NEAR(corner(scene, 1, 1), 1, 1, 0, 1e-6);
    EXPECT_VEC_NEAR(corner(scene, 1, 2), 0, 1, 0, 1e-6);
  }
}

TEST(GltfGeometry, StripsAndFansKeepTheOrientationOfTheirFirstTriangle) {
  for (const int mode : {5, 6}) {
    GltfBuilder gltf;
    // A strip zigzags over the quad, a fan goes round it; all triangles face +z.
    const std::vector<float> zigzag = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0};
    const std::vector<float> round = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 2, 0, -1, 1, 0};
    json primitive = primitiveOf(gltf, gltf.floats("VEC3", mode == 5 ? zigzag : round));
    primitive["mode"] = mode;
    gltf.node({{"mesh", gltf.mesh(primitive)}});
    const Scene scene = loadGlb(gltf);
    ASSERT_EQ(scene.geometry->triangles.size(), 3u);
    for (std::size_t t = 0; t < 3; ++t) EXPECT_VEC_NEAR(normalOf(scene, t), 0, 0, 1, 1e-6);
  }
}

TEST(GltfGeometry, PointsAndLinesAreLeftOutWithAWarning) {
  GltfBuilder gltf;
  gltf.triangle();
  json primitive = primitiveOf(gltf, gltf.floats("VEC3", kQuad));
  primitive["mode"] = 1;
  gltf.node({{"name", "wire"}, {"mesh", gltf.mesh(primitive)}});
  const Scene scene = loadGlb(gltf);
  EXPECT_EQ(scene.geometry->triangles.size(), 1u);
  EXPECT_TRUE(warns(scene, "node 'wire'"));
  EXPECT_TRUE(warns(scene, "points and lines"));
}

TEST(GltfGeometry, TransformsMultiplyDownTheHierarchy) {
  GltfBuilder gltf;
  // Child: scale 2, then a quarter turn about z, then move by (1, 0, 0). Parent, as a matrix: swap
  // nothing, scale z by 3, move by (0, 10, 0). (1, 2, 3) -> (2, 4, 6) -> (-4, 2, 6) -> (-3, 2, 6)
  // -> (-3, 12, 18).
  const double h = std::sqrt(0.5);
  const int shown = gltf.child(
      {{"mesh", gltf.mesh(primitiveOf(gltf, gltf.floats("VEC3", {1, 2, 3, 0, 0, 0, 1, 0, 0})))},
       {"scale", {2, 2, 2}},
       {"rotation", {0, 0, h, h}},
       {"translation", {1, 0, 0}}});
  gltf.node({{"children", {shown}}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 3, 0, 0, 10, 0, 1}}});
  const Scene scene = loadGlb(gltf);
  EXPECT_VEC_NEAR(corner(scene, 0, 0), -3, 12, 18, 2e-6);
  EXPECT_VEC_NEAR(corner(scene, 0, 1), 1, 10, 0, 2e-6);
  EXPECT_VEC_NEAR(corner(scene, 0, 2), 1, 12, 0, 2e-6);
}

TEST(GltfGeometry, ASceneFarFromTheOriginKeepsItsShape) {
  GltfBuilder gltf;
  gltf.triangle({0, 0, 0, 0.001f, 0, 0, 0, 0.001f, 0}, {{"translation", {5e6, -3e6, 1e6}}});
  const Scene scene = loadGlb(gltf);
  const auto& p = scene.geometry->positions;
  // At 5e6, doubles are 1e-9 apart: 2 roundings.
  EXPECT_NEAR(p[1].x - p[0].x, 0.001, 2e-9);
  EXPECT_NEAR(scene.origin.x, 5e6 + 0.0005, 2e-9);
}

TEST(GltfGeometry, AMirroredNodeKeepsItsFrontAndItsNormals) {
  GltfBuilder gltf;
  json primitive = primitiveOf(gltf, gltf.floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0}));
  primitive["attributes"]["NORMAL"] = gltf.floats("VEC3", {0, 0, 1, 0, 0, 1, 0, 0, 1});
  gltf.node({{"mesh", gltf.mesh(primitive)}, {"scale", {-1, 1, 1}}});
  const Scene scene = loadGlb(gltf);
  EXPECT_VEC_NEAR(normalOf(scene, 0), 0, 0, 1, 1e-6);  // a mirror in x leaves +z the front
  EXPECT_VEC_NEAR(scene.geometry->normals[0], 0, 0, 1, 1e-6);
  EXPECT_TRUE(scene.warnings.empty());
}

TEST(GltfGeometry, NormalsTransformByTheInverseTranspose) {
  GltfBuilder gltf;
  // The plane x + y = 1 (normal (1, 1, 0)), stretched by 2 in x: x/2 + y = 1, normal (1, 2, 0).
  json primitive = primitiveOf(gltf, gltf.floats("VEC3", {1, 0, 0, 0, 1, 0, 0, 1, 1}));
  const float h = std::sqrt(0.5f);
  primitive["attributes"]["NORMAL"] = gltf.floats("VEC3", {h, h, 0, h, h, 0, 0, 0, 0});
  gltf.node({{"mesh", gltf.mesh(primitive)}, {"scale", {2, 1, 1}}});
  const Scene scene = loadGlb(gltf);
  const double l = std::sqrt(5.0);
  EXPECT_VEC_NEAR(scene.geometry->normals[0], 1 / l, 2 / l, 0, 1e-6);
  EXPECT_VEC_NEAR(normalOf(scene, 0), 1 / l, 2 / l, 0, 1e-6);
  EXPECT_EQ(scene.geometry->normals[2], Vec3f());  // none: the face's own
}

TEST(GltfGeometry, NormalsThatLookAwayFromTheirFaceAreTurned) {
  GltfBuilder gltf;
  json primitive = primitiveOf(gltf, gltf.floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0}));
  primitive["attributes"]["NORMAL"] = gltf.floats("VEC3", {0, 0, -1, 0, 0.6f, 0.8f, 0, 0, 1});
  gltf.node({{"mesh", gltf.mesh(primitive)}});
  const Scene scene = loadGlb(gltf);
  EXPECT_VEC_NEAR(scene.geometry->normals[0], 0, 0, 1, 1e-6);
  EXPECT_VEC_NEAR(scene.geometry->normals[1], 0, 0.6, 0.8, 1e-6);
  EXPECT_TRUE(warns(scene, "1 shading normals"));
}

TEST(GltfGeometry, AttributesThatAPrimitiveLacksAreZeroWhereAnotherHasThem) {
  GltfBuilder gltf;
  gltf.triangle();
  json primitive = primitiveOf(gltf, gltf.floats("VEC3", {0, 0, 1, 1, 0, 1, 0, 1, 1}));
  primitive["attributes"]["NORMAL"] = gltf.floats("VEC3", {0, 0, 1, 0, 0, 1, 0, 0, 1});
  primitive["attributes"]["TEXCOORD_1"] = gltf.floats("VEC2", {0, 0.25f, 0.5f, 0, 1, 1});
  gltf.node({{"mesh", gltf.mesh(primitive)}});
  gltf.triangle({0, 0, 2, 1, 0, 2, 0, 1, 2});
  const Scene scene = loadGlb(gltf);
  const Geometry& g = *scene.geometry;
  ASSERT_EQ(g.positions.size(), 9u);
  ASSERT_EQ(g.normals.size(), 9u);
  ASSERT_EQ(g.uv1.size(), 9u);
  EXPECT_TRUE(g.uv0.empty());
  EXPECT_EQ(g.normals[0], Vec3f());
  EXPECT_EQ(g.normals[8], Vec3f());
  EXPECT_EQ(g.uv1[3], Vec2f(0, 0.25f));
}

TEST(GltfGeometry, QuantizedAndNormalizedAttributesAreDecoded) {
  GltfBuilder gltf;
  gltf.root["extensionsUsed"] = {"KHR_mesh_quantization"};
  gltf.root["extensionsRequired"] = {"KHR_mesh_quantization"};
  // i16 positions, padded to a stride of 8; normalized u8 and u16 texture coordinates, i8 normals.
  const std::vector<int16_t> positions = {0, 0, 0, 99, 300, 0, 0, 99, 0, -200, 0, 99};
  const int view = gltf.view(bytesOf(positions), 8);
  gltf.root["accessors"].push_back(
      {{"bufferView", view}, {"componentType", 5122}, {"type", "VEC3"}, {"count", 3}});
  json primitive = primitiveOf(gltf, 0);
  primitive["attributes"]["NORMAL"] = gltf.accessor(
      bytesOf(std::vector<int8_t>{0, 0, -127, 0, 0, -128, 0, 0, -127}), 5120, "VEC3", 3, true);
  primitive["attributes"]["TEXCOORD_0"] =
      gltf.accessor(bytesOf(std::vector<uint8_t>{0, 255, 51, 102, 0, 0}), 5121, "VEC2", 3, true);
  primitive["attributes"]["TEXCOORD_1"] = gltf.accessor(
      bytesOf(std::vector<uint16_t>{0, 65535, 13107, 0, 0, 0}), 5123, "VEC2", 3, true);
  gltf.node({{"mesh", gltf.mesh(primitive)}, {"scale", {0.01, 0.01, 0.01}}});
  const Scene scene = loadGlb(gltf);
  EXPECT_VEC_NEAR(corner(scene, 0, 1), 3, 0, 0, 1e-6);
  EXPECT_VEC_NEAR(corner(scene, 0, 2), 0, -2, 0, 1e-6);
  EXPECT_VEC_NEAR(scene.geometry->normals[1], 0, 0, -1, 1e-6);
  EXPECT_NEAR(scene.geometry->uv0[1].x, 0.2f, 1e-7);
  EXPECT_NEAR(scene.geometry->uv0[1].y, 0.4f, 1e-7);
  EXPECT_NEAR(scene.geometry->uv1[0].y, 1.0f, 0);
  EXPECT_NEAR(scene.geometry->uv1[1].x, 0.2f, 1e-7);
}

TEST(GltfGeometry, SparseAccessorsReplaceElementsOfTheirBaseOrOfZeros) {
  for (const bool with_base : {true, false}) {
    GltfBuilder gltf;
    gltf.floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
    if (!with_base) gltf.root["accessors"][0].erase("bufferView");
    json& sparse = gltf.root["accessors"][0]["sparse"];
    sparse = {
        {"count", 2},
        {"indices",
         {{"bufferView", gltf.view(bytesOf(std::vector<uint8_t>{1, 2}))}, {"componentType", 5121}}},
        {"values", {{"bufferView", gltf.view(bytesOf(std::vector<float>{5, 0, 0, 0, 7, 0}))}}}};
    gltf.node({{"mesh", gltf.mesh(primitiveOf(gltf, 0))}});
    const Scene scene = loadGlb(gltf);
    EXPECT_VEC_NEAR(corner(scene, 0, 0), 0, 0, 0, 1e-6);
    EXPECT_VEC_NEAR(corner(scene, 0, 1), 5, 0, 0, 1e-6);
    EXPECT_VEC_NEAR(corner(scene, 0, 2), 0, 7, 0, 1e-6);
  }
}

TEST(GltfGeometry, OnlyTheDefaultScenesNodesAreLoaded) {
  GltfBuilder gltf;
  gltf.triangle();
  const int other = gltf.triangle({0, 0, 9, 1, 0, 9, 0, 1, 9});
  gltf.root["scenes"] = json::array({{{"nodes", {0}}}, {{"nodes", {other}}}});
  gltf.root["scene"] = 1;
  const Scene scene = loadGlb(gltf);
  ASSERT_EQ(scene.geometry->triangles.size(), 1u);
  EXPECT_VEC_NEAR(corner(scene, 0, 0), 0, 0, 9, 1e-6);
}

TEST(GltfGeometry, ZeroAreaTrianglesAreCountedAndNoOtherFaceIsDropped) {
  GltfBuilder gltf;
  // A whole one, a repeated index, three points on a line, and a sliver 1e-6 high.
  json primitive =
      primitiveOf(gltf, gltf.floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0, 2, 0, 0, 0.5f, 1e-6f, 0}));
  primitive["indices"] = gltf.indices({0, 0, 1, 0, 1, 2, 0, 1, 3, 0, 1, 4});
  gltf.node({{"name", "floor"}, {"mesh", gltf.mesh(primitive)}});
  gltf.triangle({0, 0, 1, 1, 0, 1, 0, 1, 1});
  const Scene scene = loadGlb(gltf);
  EXPECT_EQ(scene.geometry->dropped_degenerate, 2u);
  EXPECT_EQ(scene.geometry->triangles.size(), 3u);
  EXPECT_TRUE(warns(scene, "2 triangles of zero area left out (the first in floor / mesh / 0)"));
  ASSERT_EQ(scene.geometry->meshes.size(), 2u);
  EXPECT_EQ(scene.geometry->meshes[0].triangle_count, 2u);
  EXPECT_EQ(scene.geometry->meshes[1].first_triangle, 2u);
  EXPECT_EQ(scene.geometry->meshes[1].triangle_count, 1u);
  EXPECT_EQ(scene.geometry->meshes[1].name, "node 1 / mesh / 0");
}

TEST(GltfGeometry, SkinsMorphTargetsAndVertexColoursGiveWarnings) {
  GltfBuilder gltf;
  json primitive = primitiveOf(gltf, gltf.floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0}));
  primitive["attributes"]["COLOR_0"] = gltf.floats("VEC4", std::vector<float>(12, 0.5f));
  primitive["targets"] = {{{"POSITION", 0}}};
  gltf.root["skins"] = {{{"joints", {0}}}};
  gltf.node({{"mesh", gltf.mesh(primitive)}, {"skin", 0}});
  const Scene scene = loadGlb(gltf);
  EXPECT_TRUE(warns(scene, "skin"));
  EXPECT_TRUE(warns(scene, "morph"));
  EXPECT_TRUE(warns(scene, "COLOR_0"));
}

TEST(GltfGeometry, WhiteVertexColoursGiveNoWarning) {
  GltfBuilder gltf;
  json primitive = primitiveOf(gltf, gltf.floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0}));
  primitive["attributes"]["COLOR_0"] =
      gltf.accessor(std::string(12, '\xff'), 5121, "VEC4", 3, true);
  gltf.node({{"mesh", gltf.mesh(primitive)}});
  EXPECT_TRUE(loadGlb(gltf).warnings.empty());
}

TEST(GltfGeometry, VerticesThatNoTriangleUsesAreLeftOut) {
  GltfBuilder gltf;
  json primitive =
      primitiveOf(gltf, gltf.floats("VEC3", {50, 50, 50, 0, 0, 0, 1, 0, 0, 0, 1, 0, -70, 0, 0}));
  primitive["indices"] = gltf.indices({1, 2, 3});
  gltf.node({{"mesh", gltf.mesh(primitive)}});
  const Scene scene = loadGlb(gltf);
  EXPECT_EQ(scene.geometry->positions.size(), 3u);
  EXPECT_VEC_NEAR(scene.origin, 0.5, 0.5, 0, 0);
}

}  // namespace
}  // namespace probelab::test
