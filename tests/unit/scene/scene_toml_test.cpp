// SPDX-License-Identifier: GPL-3.0-or-later
// Scene TOML: what every key does, and errors with file, line and key.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "scene/load.h"
#include "scene_files.h"

namespace probelab::test {
namespace {

const std::string kVolume = "[volume]\nmin = [0, 0, 0]\nmax = [4, 3, 5]\n";

class SceneToml : public testing::Test {
 protected:
  SceneToml() {
    GltfBuilder gltf;
    gltf.triangle({0, 0, 0, 4, 0, 0, 0, 3, 0});
    nlohmann::json lamp = {{"name", "lamp"}, {"translation", {1, 2, 3}}};
    lamp["extensions"]["KHR_lights_punctual"]["light"] =
        gltf.light({{"type", "point"}, {"color", {1, 0.5, 0}}, {"intensity", 10}});
    gltf.node(lamp);
    gltf.root["cameras"] = nlohmann::json::array(
        {{{"type", "perspective"}, {"perspective", {{"yfov", 0.75}, {"znear", 0.1}}}}});
    gltf.node({{"name", "view"}, {"camera", 0}});
    gltf.writeGlb(folder_ / "room.glb");
  }
  Scene load(const std::string& text) {
    writeBytes(folder_ / "scene.toml", text);
    return loadScene(folder_ / "scene.toml");
  }
  // The error, without the folder: "scene.toml:3: ...".
  std::string error(const std::string& text) {
    writeBytes(folder_ / "scene.toml", text);
    const std::string message = loadError(folder_ / "scene.toml");
    const std::size_t at = message.find("scene.toml");
    return at == std::string::npos ? message : message.substr(at);
  }

  TemporaryFolder folder_;
};

TEST_F(SceneToml, EveryKeyArrives) {
  const Scene scene = load(R"(gltf = "room.glb"
time_s = 0.5
[sky]
radiance = [0.5, 1, 2]
linear = [0.0, 0.6, 0.8]
[[light]]
name = "sun"
type = "directional"
color = [1.0, 0.5, 0.25]
intensity = 3
direction = [0, -2, 0]
[[light]]
name = "desk"
type = "spot"
intensity = 8.0
position = [1, 1, 1]
direction = [1, 0, 0]
inner_cone_deg = 20
outer_cone_deg = 30
range_m = 2.5
[[camera]]
name = "door"
position = [1.0, 1.5, 2.0]
target = [1.0, 1.5, 0.0]
vertical_fov_deg = 60.0
[volume]
min = [-1, -1, -1]
max = [5, 4, 5]
[receivers]
seeds = [[1, 1, 1], [2, 1, 1]]
[flip]
start = -3.0
stop = 4
)");
  EXPECT_TRUE(scene.warnings.empty());
  EXPECT_VEC_NEAR(scene.origin, 2, 1.5, 0, 0);  // of the geometry, not of the volume
  EXPECT_VEC_NEAR(toWorld(scene, scene.bounds.max), 5, 4, 5, 1e-6);
  EXPECT_EQ(scene.sky.radiance, Vec3f(0.5f, 1, 2));
  EXPECT_EQ(scene.sky.linear, Vec3f(0, 0.6f, 0.8f));
  ASSERT_EQ(scene.lights.size(), 3u);  // the glTF's own first
  EXPECT_EQ(scene.lights[0].name, "lamp");
  EXPECT_EQ(scene.lights[1].intensity, Vec3f(3, 1.5f, 0.75f));
  EXPECT_VEC_NEAR(scene.lights[1].direction, 0, -1, 0, 0);
  const Light& desk = scene.lights[2];
  EXPECT_EQ(desk.type, LightType::spot);
  EXPECT_VEC_NEAR(toWorld(scene, desk.position), 1, 1, 1, 1e-6);
  EXPECT_NEAR(desk.cos_inner, std::cos(20 * std::numbers::pi / 180), 1e-7);
  EXPECT_NEAR(desk.cos_outer, std::sqrt(3.0) / 2, 1e-7);
  EXPECT_EQ(desk.range, 2.5f);
  ASSERT_EQ(scene.cameras.size(), 2u);  // ours first
  EXPECT_EQ(scene.cameras[0].name, "door");
  EXPECT_VEC_NEAR(scene.cameras[0].forward, 0, 0, -1, 1e-6);
  EXPECT_VEC_NEAR(scene.cameras[0].up, 0, 1, 0, 1e-6);
  EXPECT_NEAR(scene.cameras[0].vertical_fov_rad, std::numbers::pi / 3, 1e-6);
  EXPECT_EQ(scene.cameras[1].name, "view");
  ASSERT_EQ(scene.receiver_seeds.size(), 2u);
  EXPECT_VEC_NEAR(toWorld(scene, scene.receiver_seeds[1]), 2, 1, 1, 1e-6);
  ASSERT_TRUE(scene.flip.has_value());
  EXPECT_EQ(scene.flip->start, -3.0f);
  EXPECT_EQ(scene.flip->stop, 4.0f);
  const SceneFeatures f = sceneFeatures(scene);
  EXPECT_TRUE(f.sky && f.sky_linear && f.directional_lights && f.point_lights && f.spot_lights);
  EXPECT_FALSE(f.sky_image);
}

TEST_F(SceneToml, WithoutGltfTheVolumeIsTheScene) {
  const Scene scene = load("[sky]\nradiance = [1.0, 1.0, 1.0]\n" + kVolume);
  EXPECT_TRUE(scene.geometry->triangles.empty());
  EXPECT_VEC_NEAR(scene.origin, 2, 1.5, 2.5, 0);
  EXPECT_VEC_NEAR(scene.bounds.min, -2, -1.5, -2.5, 0);
  EXPECT_FALSE(sceneFeatures(scene).triangles);
  EXPECT_CONTAINS(error("[sky]\nradiance = [1, 1, 1]\n"), "needs a [volume]");
}

TEST_F(SceneToml, TheNameIsTheStemWithItsFolder) {
  EXPECT_EQ(load("gltf = \"room.glb\"").name, folder_.path().filename().string() + "/scene");
  std::filesystem::create_directory(folder_ / "hall");
  writeBytes(folder_ / "hall/hall.toml", kVolume);
  EXPECT_EQ(loadScene(folder_ / "hall/hall.toml").name, "hall");
}

TEST_F(SceneToml, TheHashFollowsEveryByteAndNothingElse) {
  const std::string text = "gltf = \"room.glb\"\n";
  const std::string hash = load(text).content_hash;
  EXPECT_EQ(load(text).content_hash, hash);
  EXPECT_NE(load(text + "# a remark\n").content_hash, hash);
  GltfBuilder other;
  other.triangle();
  other.writeGlb(folder_ / "room.glb");
  EXPECT_NE(load(text).content_hash, hash);
}

TEST_F(SceneToml, AllOfASceneTurnsAboutTheVerticalAxis) {
  // A quarter turn, counter-clockwise from above: (x, y, z) -> (z, y, -x).
  const Scene scene = load(R"(gltf = "room.glb"
turn_deg = 90.0
[sky]
radiance = [1, 1, 1]
linear = [0.5, 0.0, 0.0]
[[light]]
name = "sun"
type = "directional"
intensity = 1
direction = [0.6, -0.8, 0.0]
[[camera]]
name = "own"
position = [1, 2, 3]
target = [2, 2, 3]
[receivers]
seeds = [[1, 2, 0]]
[[state]]
name = "moved"
lights = { lamp = { position = [3, 1, 2] } }
)");
  const auto at = [](const Vec3d& found, const Vec3d& wanted) {
    EXPECT_LT(length(found - wanted), 1e-6) << found.x << " " << found.y << " " << found.z;
  };
  at(toWorld(scene, scene.geometry->positions[1]), {0, 0, -4});  // was (4, 0, 0)
  at(toWorld(scene, scene.lights[0].position), {2, 1, -3});
  at(Vec3d(scene.lights[1].direction), {0, -0.8, -0.6});
  at(toWorld(scene, scene.cameras[0].position), {3, 2, -1});
  at(Vec3d(scene.cameras[0].forward), {0, 0, -1});
  at(Vec3d(scene.cameras[1].forward), {-1, 0, 0});  // the glTF's own, along -z
  at(toWorld(scene, scene.receiver_seeds[0]), {0, 2, -1});
  at(Vec3d(scene.sky.linear), {0, 0, -0.5});
  EXPECT_NE(error("turn_deg = 30.0\n" + kVolume).find("scene.toml:1: turn_deg"),
            std::string::npos);
}

TEST_F(SceneToml, ACameraMayLookStraightDown) {
  const Scene scene = load(kVolume +
                           "[[camera]]\nname = \"a\"\nposition = [1, 2, 1]\n"
                           "target = [1, 0, 1]\n");
  const Camera& camera = scene.cameras[0];
  EXPECT_NEAR(dot(camera.up, camera.forward), 0, 1e-6);
  EXPECT_NEAR(length(camera.up), 1, 1e-6);
}

TEST_F(SceneToml, UnknownKeysGiveTheLineAndTheNearestName) {
  EXPECT_CONTAINS(error("gltf = \"room.glb\"\nvolumes = 3\n"),
                  "scene.toml:2: unknown key 'volumes', did you mean 'volume'?");
  EXPECT_CONTAINS(error("[sky]\n\nradience = [1, 1, 1]\n"),
                  "scene.toml:3: [sky]: unknown key 'radience', did you mean 'radiance'?");
  EXPECT_CONTAINS(
      error("[[light]]\nname = \"sun\"\ntype = \"point\"\nintensty = 3\n"),
      "scene.toml:4: [[light]] 'sun': unknown key 'intensty', did you mean 'intensity'?");
  EXPECT_CONTAINS(
      error("gltf = \"room.glb\"\n[[state]]\nname = \"a\"\nlights = { lamp = { colour = 1 } }\n"),
      "scene.toml:4: [[state]] 'a', lights, 'lamp': unknown key 'colour', did you mean "
      "'color'?");
}

TEST_F(SceneToml, WhatIsNoTomlGivesTheLine) {
  EXPECT_CONTAINS(error("gltf = \"room.glb\"\n[volume\n"), "scene.toml:2: is not valid TOML");
  EXPECT_CONTAINS(error("gltf = \"room.glb\"\ngltf = \"b.glb\"\n"), "scene.toml:2: is not valid");
}

TEST_F(SceneToml, WrongTypesAndRangesGiveTheLine) {
  const std::string light = "[[light]]\nname = \"a\"\ntype = \"point\"\nposition = [0, 0, 0]\n";
  EXPECT_CONTAINS(error("gltf = 7\n"), "scene.toml:1: gltf must be a string");
  EXPECT_CONTAINS(error("gltf = \"none.glb\"\n"), "scene.toml:1: gltf = '");
  EXPECT_CONTAINS(error("time_s = \"now\"\n"), "scene.toml:1: time_s must be a number");
  EXPECT_CONTAINS(error("time_s = nan\n"), "scene.toml:1: time_s is nan, must be finite");
  EXPECT_CONTAINS(error("sky = 1\n"), "scene.toml:1: sky must be a table, [sky]");
  EXPECT_CONTAINS(error("[sky]\nradiance = [1, 1]\n"),
                  "scene.toml:2: [sky]: radiance must be three");
  EXPECT_CONTAINS(error("[sky]\nradiance = [1, -1, 1]\n"), "radiance is -1, must be 0 or more");
  EXPECT_CONTAINS(error("[sky]\nradiance = [1, inf, 1]\n"), "radiance is inf, must be finite");
  EXPECT_CONTAINS(error("[sky]\nradiance = [1, 1e300, 1]\n"), "must be finite");
  EXPECT_CONTAINS(error("[sky]\nradiance = [1, 1, 1]\nlinear = [1, 1, 0]\n"),
                  "scene.toml:3: [sky]: the length of linear is 1.41");
  EXPECT_CONTAINS(error("[light]\nname = \"a\"\n"),
                  "scene.toml:1: light is a list: write [[light]]");
  EXPECT_CONTAINS(error(light), "scene.toml:1: [[light]] 'a': intensity is missing");
  EXPECT_CONTAINS(error(light + "intensity = -1\n"),
                  "scene.toml:5: [[light]] 'a': intensity is -1");
  EXPECT_CONTAINS(error(light + "intensity = 1\ndirection = [1, 0, 0]\n"),
                  "scene.toml:6: [[light]] 'a': a point light has no direction");
  EXPECT_CONTAINS(error("[[light]]\nname = \"a\"\ntype = \"laser\"\n"),
                  "scene.toml:3: [[light]] 'a': type is 'laser', which is not known");
  EXPECT_CONTAINS(error("[[light]]\ntype = \"point\"\n"),
                  "scene.toml:1: [[light]]: name is missing");
  EXPECT_CONTAINS(error("[[light]]\nname = \"a\"\ntype = \"directional\"\nintensity = 1\n"
                        "direction = [0, 0, 0]\n"),
                  "scene.toml:5: [[light]] 'a': direction is zero");
  EXPECT_CONTAINS(error("[[camera]]\nname = \"c\"\nposition = [1, 1, 1]\ntarget = [1, 1, 1]\n"),
                  "scene.toml:4: [[camera]] 'c': target is the camera's own position");
  EXPECT_CONTAINS(error("[[camera]]\nname = \"c\"\nposition = [1, 1, 1]\ntarget = [1, 1, 2]\n"
                        "vertical_fov_deg = 180\n"),
                  "scene.toml:5: [[camera]] 'c': vertical_fov_deg is 180");
  EXPECT_CONTAINS(error("[[camera]]\nname = \"c\"\nposition = [1, 1, 2e7]\ntarget = [1, 1, 2]\n"),
                  "scene.toml:3: [[camera]] 'c': position is");
  EXPECT_CONTAINS(error("[flip]\nstart = 2.0\nstop = 1.0\n"),
                  "scene.toml:3: [flip]: start must be");
  EXPECT_CONTAINS(error(kVolume + "[receivers]\nseeds = [[0, 0]]\n"), "scene.toml:5: [receivers]");
}

TEST_F(SceneToml, AVolumeWithoutSizeIsAnError) {
  EXPECT_CONTAINS(error("[volume]\nmin = [0, 0, 0]\nmax = [1, 0, 1]\n"),
                  "scene.toml:3: [volume]: the volume has no size along y");
  EXPECT_CONTAINS(error("[volume]\nmin = [0, 0, 0]\n"), "scene.toml:1: [volume]: max is missing");
  // 1e7 m from the geometry, floats are 1 m apart.
  EXPECT_CONTAINS(error("gltf = \"room.glb\"\n[volume]\nmin = [9999990, 0, 0]\n"
                        "max = [9999990.1, 1, 1]\n"),
                  "too thin");
}

TEST_F(SceneToml, SeedsMustLieInTheVolume) {
  EXPECT_CONTAINS(error(kVolume + "[receivers]\nseeds = [[1, 1, 1], [1, 9, 1]]\n"),
                  "scene.toml:4: the seed (1, 9, 1) lies outside the volume");
}

TEST_F(SceneToml, NamesMustBeUnique) {
  const std::string camera = "[[camera]]\nname = \"c\"\nposition = [0, 0, 0]\ntarget = [1, 1, 2]\n";
  EXPECT_CONTAINS(error(camera + camera), "scene.toml:6: [[camera]]: the name 'c' is used twice");
  EXPECT_CONTAINS(error(kVolume + "[[state]]\nname = \"s\"\n[[state]]\nname = \"s\"\n"),
                  "the name 's' is used twice");
  EXPECT_CONTAINS(error("gltf = \"room.glb\"\n[[light]]\nname = \"lamp\"\ntype = \"point\"\n"
                        "intensity = 1\nposition = [0, 0, 0]\n"),
                  "the light 'lamp' exists in the glTF too");
}

TEST_F(SceneToml, StatesNameLightsThatExist) {
  const std::string head = "gltf = \"room.glb\"\n[[state]]\nname = \"s\"\n";
  EXPECT_CONTAINS(error(head + "lights = { lmap = { intensity = 1 } }\n"),
                  "scene.toml:4: [[state]] 's': there is no light 'lmap', did you mean 'lamp'?");
  EXPECT_CONTAINS(error(head + "lights = { lamp = { direction = [1, 0, 0] } }\n"),
                  "'lamp' is a point light and has no direction");
  EXPECT_CONTAINS(error(head + "lights = { lamp = { intensity = -1 } }\n"), "scene.toml:4:");
  EXPECT_CONTAINS(error(head + "split = \"test\"\n"),
                  "scene.toml:4: [[state]] 's': split is 'test'");
}

TEST_F(SceneToml, StatesStartFromTheSceneAsItStands) {
  const Scene first = load(R"(gltf = "room.glb"
[sky]
radiance = [1, 1, 1]
[[light]]
name = "sun"
type = "directional"
intensity = 2
direction = [0, -1, 0]
[[state]]
name = "dim"
lights = { lamp = { intensity = 1 }, sun = { direction = [2, 0, 0], color = [0, 1, 0] } }
sky_scale = 0.25
[[state]]
name = "moved"
split = "heldout"
lights = { lamp = { position = [3, 2, 1], color = [0, 0, 1] } }
)");
  EXPECT_EQ(first.state, "dim");
  ASSERT_EQ(first.states.size(), 2u);
  EXPECT_EQ(first.states[1].split, Split::heldout);
  EXPECT_EQ(first.lights[0].intensity, Vec3f(1, 0.5f, 0));
  EXPECT_EQ(first.lights[1].intensity, Vec3f(0, 2, 0));
  EXPECT_VEC_NEAR(first.lights[1].direction, 1, 0, 0, 0);
  EXPECT_EQ(first.sky.scale, 0.25f);
  const Scene moved = withState(first, "moved");
  EXPECT_EQ(moved.state, "moved");
  EXPECT_EQ(moved.lights[0].intensity, Vec3f(0, 0, 10));
  EXPECT_VEC_NEAR(toWorld(moved, moved.lights[0].position), 3, 2, 1, 1e-6);
  EXPECT_EQ(moved.lights[1].intensity, Vec3f(2.0f));
  EXPECT_VEC_NEAR(moved.lights[1].direction, 0, -1, 0, 0);
  EXPECT_EQ(moved.sky.scale, 1.0f);
  EXPECT_EQ(moved.geometry, first.geometry);
  const Scene back = withState(moved, "dim");
  EXPECT_EQ(back.lights[0].intensity, first.lights[0].intensity);
  EXPECT_VEC_NEAR(toWorld(back, back.lights[0].position), 1, 2, 3, 1e-6);
  try {
    withState(first, "move");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_CONTAINS(e.what(), "no lighting state 'move', did you mean 'moved'?");
  }
}

TEST_F(SceneToml, AStateCanSwitchABlackLightOn) {
  const Scene scene = load(kVolume +
                           "[[light]]\nname = \"a\"\ntype = \"point\"\nintensity = 3\n"
                           "color = [0, 0, 0]\nposition = [1, 1, 1]\n"
                           "[[state]]\nname = \"s\"\nlights = { a = { color = [1, 1, 2] } }\n");
  EXPECT_EQ(scene.lights[0].intensity, Vec3f(3, 3, 6));
}

void writeExr(const std::filesystem::path& path, int width, int height,
              const std::vector<float>& rgb, const std::vector<const char*>& names) {
  Imf::Header header(width, height);
  header.dataWindow() = Imath::Box2i({5, -3}, {width + 4, height - 4});
  Imf::FrameBuffer frame;
  for (std::size_t c = 0; c < names.size(); ++c) {
    header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
    frame.insert(names[c], Imf::Slice::Make(Imf::FLOAT, rgb.data() + c, header.dataWindow(),
                                            names.size() * sizeof(float),
                                            names.size() * sizeof(float) * width));
  }
  Imf::OutputFile file(path.c_str(), header);
  file.setFrameBuffer(frame);
  file.writePixels(height);
}

TEST_F(SceneToml, ASkyImageIsReadTexelByTexel) {
  std::vector<float> rgb(2 * 40 * 3);
  for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = 0.5f + static_cast<float>(i) * 1000;
  writeExr(folder_ / "sky.exr", 2, 40, rgb, {"R", "G", "B"});
  const Scene scene = load("[sky]\nimage = \"sky.exr\"\n" + kVolume);
  EXPECT_EQ(scene.sky.width, 2);
  ASSERT_EQ(scene.sky.height, 40);
  for (std::size_t i = 0; i < 80; ++i)
    EXPECT_EQ(scene.sky.image[i], Vec3f(rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]));
  const SceneFeatures f = sceneFeatures(scene);
  EXPECT_TRUE(f.sky && f.sky_image);
  writeExr(folder_ / "sky.exr", 2, 1, {3, 4}, {"Y"});
  EXPECT_EQ(load("[sky]\nimage = \"sky.exr\"\n" + kVolume).sky.image[1], Vec3f(4.0f));
}

TEST_F(SceneToml, BadSkyImagesAreErrors) {
  const std::string text = "[sky]\nimage = \"sky.exr\"\n" + kVolume;
  EXPECT_CONTAINS(error(text), "scene.toml:2: [sky]: image = '");
  writeBytes(folder_ / "sky.exr", "no image at all");
  EXPECT_CONTAINS(error(text), "sky.exr: cannot be read as an EXR image");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const float bad : {nan, -1.0f}) {
    writeExr(folder_ / "sky.exr", 2, 1, {1, 1, 1, 1, bad, 1}, {"R", "G", "B"});
    EXPECT_CONTAINS(error(text), "sky.exr: texel (1, 0) is negative or not finite");
  }
  writeExr(folder_ / "sky.exr", 1, 1, {1, 1}, {"R", "Z"});
  EXPECT_CONTAINS(error(text), "sky.exr: has neither channels R, G, B nor Y");
  EXPECT_CONTAINS(error("[sky]\nimage = \"sky.exr\"\nradiance = [1, 1, 1]\n"),
                  "scene.toml:2: [sky]");
}

TEST_F(SceneToml, EveryTruncationOfASkyImageIsAnError) {
  std::vector<float> rgb(8 * 20 * 3, 1.0f);
  for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<float>(i * 7919 % 101);
  writeExr(folder_ / "whole.exr", 8, 20, rgb, {"R", "G", "B"});
  std::ifstream in(folder_ / "whole.exr", std::ios::binary);
  const std::string whole(std::istreambuf_iterator<char>(in), {});
  for (std::size_t size = 0; size < whole.size(); size += 7) {
    writeBytes(folder_ / "sky.exr", whole.substr(0, size));
    EXPECT_CONTAINS(error("[sky]\nimage = \"sky.exr\"\n" + kVolume), "sky.exr: ");
  }
}

}  // namespace
}  // namespace probelab::test
