// SPDX-License-Identifier: GPL-3.0-or-later
// Materials and textures of glTF files.
#include <cmath>
#include <numbers>

#include "scene/load.h"
#include "scene_files.h"

namespace probelab::test {
namespace {

using nlohmann::json;

Scene loadMaterial(const json& material) {
  GltfBuilder gltf;
  const int index = gltf.material(material);
  gltf.triangle({0, 0, 0, 1, 0, 0, 0, 1, 0}, json::object(), index);
  return loadGlb(gltf);
}

// A quad's worth of texture coordinates on one triangle.
void addTexturedTriangle(GltfBuilder& gltf, const json& material) {
  json primitive = {{"attributes",
                     {{"POSITION", gltf.floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0})},
                      {"TEXCOORD_0", gltf.floats("VEC2", {0, 0, 1, 0, 0, 1})},
                      {"TEXCOORD_1", gltf.floats("VEC2", {0, 0, 1, 0, 0, 1})}}},
                    {"material", gltf.material(material)}};
  gltf.node({{"mesh", gltf.mesh(primitive)}});
}

Vec2f apply(const TextureUse& use, float u, float v) {
  const auto& m = use.transform;
  return {m[0] * u + m[1] * v + m[2], m[3] * u + m[4] * v + m[5]};
}

TEST(GltfMaterial, FactorsArriveAsTheyAre) {
  const Scene scene = loadMaterial(
      {{"name", "paint"},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {0.25, 0.5, 0.75, 0.125}}, {"metallicFactor", 0.5}}},
       {"emissiveFactor", {0.5, 0.25, 1}},
       {"alphaMode", "MASK"},
       {"alphaCutoff", 0.25},
       {"doubleSided", true},
       {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}}}}});
  ASSERT_EQ(scene.materials.size(), 1u);
  const Material& m = scene.materials[0];
  EXPECT_EQ(m.name, "paint");
  EXPECT_EQ(m.base_color, Vec3f(0.25f, 0.5f, 0.75f));
  EXPECT_EQ(m.base_alpha, 0.125f);
  EXPECT_EQ(m.metallic, 0.5f);
  EXPECT_EQ(m.emission, Vec3f(4, 2, 8));
  EXPECT_TRUE(m.alpha_mask);
  EXPECT_EQ(m.alpha_cutoff, 0.25f);
  EXPECT_TRUE(m.double_sided);
  EXPECT_TRUE(scene.warnings.empty());
  const SceneFeatures f = sceneFeatures(scene);
  EXPECT_TRUE(f.triangles && f.alpha_mask && f.double_sided && f.emission);
  EXPECT_FALSE(f.textures || f.shading_normals || f.sky || f.point_lights);
}

TEST(GltfMaterial, AMetallicSurfaceThatEndsBlackGivesAWarning) {
  const Scene scene = loadMaterial({{"name", "chrome"}});
  EXPECT_EQ(scene.materials[0].metallic, 1.0f);
  EXPECT_TRUE(warns(scene, "material 'chrome': is fully metallic"));
}

TEST(GltfMaterial, ABlackEmitterIsNotReportedAsMetal) {
  const Scene scene = loadMaterial({{"pbrMetallicRoughness", {{"baseColorFactor", {0, 0, 0, 1}}}},
                                    {"emissiveFactor", {1, 1, 1}}});
  EXPECT_TRUE(scene.warnings.empty());
}

TEST(GltfMaterial, APrimitiveWithoutMaterialGetsTheDefaultOne) {
  GltfBuilder gltf;
  gltf.node(
      {{"mesh", gltf.mesh({{"attributes",
                            {{"POSITION", gltf.floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0})}}}})}});
  const Scene scene = loadGlb(gltf);
  ASSERT_EQ(scene.materials.size(), 1u);
  EXPECT_EQ(scene.materials[0].base_color, Vec3f(1.0f));
  EXPECT_EQ(scene.materials[0].metallic, 1.0f);
  EXPECT_TRUE(warns(scene, "default material"));
}

TEST(GltfMaterial, OnlyMaterialsInUseAreKept) {
  GltfBuilder gltf;
  gltf.material({{"name", "broken"}, {"pbrMetallicRoughness", {{"metallicFactor", 7}}}});
  gltf.triangle();
  const Scene scene = loadGlb(gltf);
  EXPECT_EQ(scene.materials.size(), 1u);
  EXPECT_EQ(scene.geometry->triangles[0].material, 0u);
}

TEST(GltfMaterial, BlendAndUnlitGiveWarnings) {
  json material = matte();
  material["alphaMode"] = "BLEND";
  material["name"] = "glass";
  GltfBuilder gltf;
  gltf.root["extensionsUsed"] = {"KHR_materials_unlit"};
  material["extensions"]["KHR_materials_unlit"] = json::object();
  const int index = gltf.material(material);
  gltf.triangle({0, 0, 0, 1, 0, 0, 0, 1, 0}, json::object(), index);
  const Scene scene = loadGlb(gltf);
  EXPECT_TRUE(warns(scene, "material 'glass': alphaMode BLEND"));
  EXPECT_TRUE(warns(scene, "KHR_materials_unlit is ignored"));
  EXPECT_FALSE(scene.materials[0].alpha_mask);
}

TEST(GltfMaterial, TexturesArriveTexelByTexelWithTheirSampler) {
  GltfBuilder gltf;
  const std::vector<uint8_t> texels = {255, 0, 0, 255, 0, 255, 0, 128, 0, 0, 255, 0, 1, 2, 3, 4};
  const int clamped = gltf.texture(pngFile(2, 2, texels),
                                   {{"wrapS", 33071}, {"wrapT", 33648}, {"magFilter", 9728}});
  const int plain = gltf.texture(pngFile(1, 1, {7, 8, 9, 255}));
  json material = {{"pbrMetallicRoughness",
                    {{"baseColorTexture", {{"index", clamped}, {"texCoord", 1}}},
                     {"metallicRoughnessTexture", {{"index", plain}}}}},
                   {"emissiveFactor", {1, 1, 1}},
                   {"emissiveTexture", {{"index", plain}}}};
  addTexturedTriangle(gltf, material);
  const Scene scene = loadGlb(gltf);
  EXPECT_TRUE(scene.warnings.empty());
  ASSERT_EQ(scene.textures.size(), 2u);
  const Material& m = scene.materials[0];
  EXPECT_EQ(scene.textures[m.base_color_texture.texture].rgba, texels);
  EXPECT_EQ(m.base_color_texture.uv_set, 1);
  EXPECT_EQ(m.base_color_texture.wrap_u, TextureWrap::clamp);
  EXPECT_EQ(m.base_color_texture.wrap_v, TextureWrap::mirror);
  EXPECT_TRUE(m.base_color_texture.nearest);
  EXPECT_EQ(m.metallic_texture.texture, m.emission_texture.texture);
  EXPECT_EQ(m.metallic_texture.wrap_u, TextureWrap::repeat);
  EXPECT_FALSE(m.metallic_texture.nearest);
  EXPECT_TRUE(sceneFeatures(scene).textures);
}

TEST(GltfMaterial, ATextureThatItsFactorCancelsIsNotLoaded) {
  GltfBuilder gltf;
  const int broken = gltf.texture("not an image");
  json material = matte();
  material["emissiveTexture"] = {{"index", broken}};
  material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {{"index", broken}};
  addTexturedTriangle(gltf, material);
  EXPECT_TRUE(loadGlb(gltf).textures.empty());
}

TEST(GltfMaterial, AMetallicTextureCountsInTheBlackMetalWarning) {
  for (const uint8_t blue : {uint8_t{255}, uint8_t{254}}) {
    GltfBuilder gltf;
    const int texture = gltf.texture(pngFile(1, 1, {0, 0, blue, 255}));
    addTexturedTriangle(
        gltf, {{"pbrMetallicRoughness", {{"metallicRoughnessTexture", {{"index", texture}}}}}});
    EXPECT_EQ(warns(loadGlb(gltf), "fully metallic"), blue == 255);
  }
}

TEST(GltfMaterial, TextureTransformsScaleThenTurnThenMove) {
  GltfBuilder gltf;
  const int texture = gltf.texture(pngFile(1, 1, {7, 8, 9, 255}));
  json material = matte();
  material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", texture},
                                                          {"extensions",
                                                           {{"KHR_texture_transform",
                                                             {{"offset", {0.5, 0.25}},
                                                              {"scale", {2, 4}},
                                                              {"rotation", std::numbers::pi / 2},
                                                              {"texCoord", 1}}}}}};
  addTexturedTriangle(gltf, material);
  const TextureUse use = loadGlb(gltf).materials[0].base_color_texture;
  EXPECT_EQ(use.uv_set, 1);
  // Counter-clockwise on an image whose v runs down: (1, 0) turns to (0, -1), (0, 1) to (1, 0).
  EXPECT_NEAR(apply(use, 1, 0).x, 0.5, 1e-6);
  EXPECT_NEAR(apply(use, 1, 0).y, 0.25 - 2, 1e-6);
  EXPECT_NEAR(apply(use, 0, 1).x, 0.5 + 4, 1e-6);
  EXPECT_NEAR(apply(use, 0, 1).y, 0.25, 1e-6);
}

TEST(GltfMaterial, AMissingTextureCoordinateGivesAWarning) {
  GltfBuilder gltf;
  const int texture = gltf.texture(pngFile(1, 1, {7, 8, 9, 255}));
  json material = matte();
  material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", texture}};
  const int index = gltf.material(material);
  gltf.triangle({0, 0, 0, 1, 0, 0, 0, 1, 0}, {{"name", "box"}}, index);
  EXPECT_TRUE(warns(loadGlb(gltf), "node 'box', mesh 'mesh', primitive 0: has no TEXCOORD_0"));
}

TEST(GltfMaterial, ImagesInFilesAndDataUrisAreRead) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "maps");
  const std::string png = pngFile(1, 1, {1, 2, 3, 4});
  writeBytes(folder / "maps/my wall.png", png);
  for (const std::string& uri :
       {std::string("maps/my%20wall.png"), "data:image/png;base64," + base64(png)}) {
    GltfBuilder gltf;
    gltf.root["images"].push_back({{"uri", uri}});
    gltf.root["textures"].push_back({{"source", 0}});
    json material = matte();
    material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    addTexturedTriangle(gltf, material);
    gltf.writeGltf(folder / "scene.gltf");
    const Scene scene = loadScene(folder / "scene.gltf");
    ASSERT_EQ(scene.textures.size(), 1u);
    EXPECT_EQ(scene.textures[0].rgba, (std::vector<uint8_t>{1, 2, 3, 4}));
  }
}

TEST(GltfMaterial, BadMaterialsAreErrorsThatNameThem) {
  const auto error_of = [](json material) {
    material["name"] = "wall";
    GltfBuilder gltf;
    gltf.texture("not an image");
    addTexturedTriangle(gltf, material);
    const TemporaryFolder folder;
    gltf.writeGlb(folder / "scene.glb");
    const std::string error = loadError(folder / "scene.glb");
    EXPECT_CONTAINS(error, "scene.glb: ");
    return error;
  };
  const auto pbr = [](const char* key, const json& value) {
    return json{{"pbrMetallicRoughness", {{key, value}}}};
  };
  EXPECT_CONTAINS(error_of(pbr("baseColorFactor", {1.5, 1, 1, 1})),
                  "material 'wall': baseColorFactor is 1.5");
  EXPECT_CONTAINS(error_of(pbr("baseColorFactor", {-0.5, 1, 1, 1})), "material 'wall'");
  EXPECT_CONTAINS(error_of(pbr("baseColorFactor", {1, 1, 1})), "materials[0]");
  EXPECT_CONTAINS(error_of(pbr("metallicFactor", -1)), "material 'wall': metallicFactor");
  EXPECT_CONTAINS(error_of(pbr("metallicFactor", "zero")),
                  "materials[0].pbrMetallicRoughness.metallicFactor: must be a number");
  EXPECT_CONTAINS(error_of({{"emissiveFactor", {-1, 0, 0}}}), "material 'wall': emission");
  EXPECT_CONTAINS(error_of({{"emissiveFactor", {1e300, 0, 0}}}), "material 'wall': emission");
  EXPECT_CONTAINS(error_of({{"alphaMode", "CUT"}}), "material 'wall': alphaMode 'CUT'");
  EXPECT_CONTAINS(error_of(pbr("baseColorTexture", {{"index", 0}, {"texCoord", 2}})),
                  "material 'wall': uses TEXCOORD_2");
  EXPECT_CONTAINS(error_of(pbr("baseColorTexture", {{"index", 5}})),
                  "baseColorTexture.index: is 5, but there are 1 textures");
  EXPECT_CONTAINS(error_of(pbr("baseColorTexture", {{"index", 0}})),
                  "material 'wall': image 0 cannot be decoded");
}

}  // namespace
}  // namespace probelab::test
