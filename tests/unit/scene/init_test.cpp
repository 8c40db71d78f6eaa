// SPDX-License-Identifier: GPL-3.0-or-later
// The scene TOML that `probelab init` writes: it loads, and says what it should.
#include "scene/init.h"

#include <cmath>

#include "scene/load.h"
#include "scene_files.h"

namespace probelab::test {
namespace {

class Init : public testing::Test {
 protected:
  // A box of 8 x 3 x 5 m, as far as its corners go.
  void addRoom(const nlohmann::json& node = nlohmann::json::object()) {
    gltf_.triangle({0, 0, 0, 8, 0, 0, 0, 3, 5}, node);
  }
  Scene loadDirectly() {
    gltf_.writeGlb(folder_ / "my room.glb");
    return loadScene(folder_ / "my room.glb");
  }
  Scene roundTrip(const Scene& scene) {
    text_ = describeSceneToml(scene, "my room.glb", defaultCameraPosition(scene));
    writeBytes(folder_ / "scene.toml", text_);
    return loadScene(folder_ / "scene.toml");
  }

  TemporaryFolder folder_;
  GltfBuilder gltf_;
  std::string text_;
};

TEST_F(Init, AnUnlitFileGetsCameraSunAndSky) {
  addRoom();
  const Scene direct = loadDirectly();
  EXPECT_TRUE(isUnlit(direct));
  EXPECT_VEC_NEAR(defaultCameraPosition(direct), 4, 1.2, 2.5, 1e-6);
  const Scene scene = roundTrip(direct);
  EXPECT_TRUE(scene.warnings.empty());
  ASSERT_EQ(scene.lights.size(), 1u);
  EXPECT_EQ(scene.lights[0].name, "sun");
  EXPECT_FALSE(scene.sky.black());
  ASSERT_EQ(scene.cameras.size(), 1u);
  EXPECT_VEC_NEAR(toWorld(scene, scene.cameras[0].position), 4, 1.2, 2.5, 1e-3);
  EXPECT_VEC_NEAR(scene.cameras[0].forward, 1, 0, 0, 1e-6);  // the longest axis
}

TEST_F(Init, TheBoundsAreRoundedOutwardsByLessThanAThousandthOfTheSize) {
  addRoom({{"translation", {-0.123456, 7.654321, 1.0 / 3}}});
  const Scene direct = loadDirectly();
  const Scene scene = roundTrip(direct);
  for (int axis = 0; axis < 3; ++axis) {
    const double min = toWorld(direct, direct.bounds.min)[axis];
    const double max = toWorld(direct, direct.bounds.max)[axis];
    // Both sides were rounded to fp32 on the way: 1e-6.
    EXPECT_LE(toWorld(scene, scene.bounds.min)[axis], min + 1e-6);
    EXPECT_GE(toWorld(scene, scene.bounds.max)[axis], max - 1e-6);
    EXPECT_NEAR(toWorld(scene, scene.bounds.min)[axis], min, 0.017);
    EXPECT_NEAR(toWorld(scene, scene.bounds.max)[axis], max, 0.017);
  }
}

TEST_F(Init, LightsAndCamerasOfTheFileAreKept) {
  addRoom();
  nlohmann::json lamp = {{"name", "lamp \"1\"\n[sky]"}};
  lamp["extensions"]["KHR_lights_punctual"]["light"] = gltf_.light({{"type", "point"}});
  gltf_.node(lamp);
  gltf_.root["cameras"] = nlohmann::json::array(
      {{{"type", "perspective"}, {"perspective", {{"yfov", 0.75}, {"znear", 0.1}}}}});
  gltf_.node({{"name", "view"}, {"camera", 0}});
  const Scene scene = roundTrip(loadDirectly());
  EXPECT_EQ(scene.lights.size(), 1u);
  EXPECT_EQ(scene.cameras.size(), 1u);
  EXPECT_TRUE(scene.sky.black());
}

TEST_F(Init, AFileThatGlowsNeedsNoSun) {
  nlohmann::json material = matte();
  material["emissiveFactor"] = {1, 1, 1};
  const int glow = gltf_.material(material);
  gltf_.triangle({0, 0, 0, 1, 0, 0, 0, 1, 0}, nlohmann::json::object(), glow);
  const Scene scene = roundTrip(loadDirectly());
  EXPECT_TRUE(scene.lights.empty());
  EXPECT_TRUE(scene.sky.black());
}

TEST_F(Init, ScenesOfEverySizeComeBack) {
  for (const double scale : {1e-4, 0.03, 1.0, 170.0, 1e6}) {
    gltf_ = GltfBuilder();
    addRoom({{"scale", {scale, scale, scale}}});
    const Scene direct = loadDirectly();
    const Scene scene = roundTrip(direct);
    // Two outward roundings, of a thousandth of the box's three edges each.
    EXPECT_NEAR(scene.bounds.diagonal() / direct.bounds.diagonal(), 1, 4e-3) << text_;
    EXPECT_EQ(scene.geometry->triangles.size(), 1u);
  }
}

}  // namespace
}  // namespace probelab::test
