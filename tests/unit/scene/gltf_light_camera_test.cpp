// SPDX-License-Identifier: GPL-3.0-or-later
// KHR_lights_punctual, cameras and node animation.
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "scene/load.h"
#include "scene_files.h"

namespace probelab::test {
namespace {

using nlohmann::json;
constexpr double kHalf = 0.70710678118654752;

json lightNode(int light, json node = json::object()) {
  node["extensions"]["KHR_lights_punctual"]["light"] = light;
  return node;
}

TEST(GltfLight, OmittedValuesAreTheExtensionsDefaults) {
  GltfBuilder gltf;
  gltf.triangle();
  gltf.node(lightNode(gltf.light({{"type", "point"}})));
  const Scene scene = loadGlb(gltf);
  ASSERT_EQ(scene.lights.size(), 1u);
  const Light& light = scene.lights[0];
  EXPECT_EQ(light.type, LightType::point);
  EXPECT_EQ(light.intensity, Vec3f(1.0f));
  EXPECT_TRUE(std::isinf(light.range));
  EXPECT_EQ(light.name, "light 0");
  EXPECT_EQ(scene.light_colors[0], Vec3f(1.0f));
  EXPECT_TRUE(sceneFeatures(scene).point_lights);
}

TEST(GltfLight, ASpotTravelsAlongItsNodesMinusZ) {
  GltfBuilder gltf;
  gltf.triangle();
  gltf.root["extensionsUsed"] = {"KHR_lights_punctual"};
  const int light = gltf.light({{"type", "spot"},
                                {"name", "lamp data"},
                                {"color", {1, 0.5, 0.25}},
                                {"intensity", 40},
                                {"range", 6},
                                {"spot", {{"innerConeAngle", 0.25}, {"outerConeAngle", 0.5}}}});
  // A quarter turn about y takes -z to -x; the scale must not change the intensity.
  const int lamp = gltf.child(lightNode(light, {{"name", "lamp"}, {"translation", {0, 0, 1}}}));
  gltf.node({{"rotation", {0, kHalf, 0, kHalf}}, {"scale", {3, 3, 3}}, {"children", {lamp}}});
  const Scene scene = loadGlb(gltf);
  EXPECT_TRUE(scene.warnings.empty());
  const Light& l = scene.lights.at(0);
  EXPECT_EQ(l.name, "lamp");
  EXPECT_EQ(l.type, LightType::spot);
  EXPECT_VEC_NEAR(l.direction, -1, 0, 0, 1e-6);
  EXPECT_VEC_NEAR(toWorld(scene, l.position), 3, 0, 0, 1e-6);
  EXPECT_EQ(l.intensity, Vec3f(40, 20, 10));
  EXPECT_EQ(l.range, 6.0f);
  EXPECT_NEAR(l.cos_inner, std::cos(0.25), 1e-7);
  EXPECT_NEAR(l.cos_outer, std::cos(0.5), 1e-7);
  EXPECT_EQ(scene.light_colors[0], Vec3f(1, 0.5f, 0.25f));
  EXPECT_EQ(scene.light_intensities[0], 40.0f);
}

TEST(GltfLight, RepeatedNamesAreNumbered) {
  GltfBuilder gltf;
  gltf.triangle();
  const int light = gltf.light({{"type", "point"}, {"name", "bulb"}});
  for (int i = 0; i < 3; ++i) gltf.node(lightNode(light));
  const Scene scene = loadGlb(gltf);
  ASSERT_EQ(scene.lights.size(), 3u);
  EXPECT_EQ(scene.lights[0].name, "bulb");
  EXPECT_EQ(scene.lights[1].name, "bulb#2");
  EXPECT_EQ(scene.lights[2].name, "bulb#3");
}

TEST(GltfLight, BadLightsAreErrorsThatNameThem) {
  const auto error_of = [](json light) {
    light["name"] = "bulb";
    GltfBuilder gltf;
    gltf.triangle();
    gltf.node(lightNode(gltf.light(light)));
    const TemporaryFolder folder;
    gltf.writeGlb(folder / "scene.glb");
    return loadError(folder / "scene.glb");
  };
  EXPECT_CONTAINS(error_of({{"type", "laser"}}), "light 'bulb': its type 'laser'");
  EXPECT_CONTAINS(error_of({{"type", "point"}, {"intensity", -1}}), "light 'bulb': its colour and");
  EXPECT_CONTAINS(error_of({{"type", "point"}, {"intensity", 1e300}}), "light 'bulb'");
  EXPECT_CONTAINS(error_of({{"type", "point"}, {"color", {1, -1, 1}}}), "light 'bulb'");
  EXPECT_CONTAINS(error_of({{"type", "point"}, {"range", -2}}), "light 'bulb': its range is -2");
  EXPECT_CONTAINS(
      error_of({{"type", "spot"}, {"spot", {{"innerConeAngle", 0.5}, {"outerConeAngle", 0.25}}}}),
      "light 'bulb': its cone angles");
  EXPECT_CONTAINS(error_of({{"type", "spot"}, {"spot", {{"outerConeAngle", 2}}}}), "light 'bulb'");
}

TEST(GltfCamera, APerspectiveCameraLooksAlongItsNodesMinusZ) {
  GltfBuilder gltf;
  gltf.triangle();
  gltf.root["cameras"] =
      json::array({{{"type", "perspective"}, {"perspective", {{"yfov", 0.75}, {"znear", 0.1}}}},
                   {{"type", "orthographic"},
                    {"name", "plan"},
                    {"orthographic", {{"xmag", 1}, {"ymag", 1}, {"zfar", 9}, {"znear", 0.1}}}}});
  // A quarter turn about x takes -z to +y and +y to +z.
  gltf.node({{"name", "eye"},
             {"camera", 0},
             {"translation", {1, 2, 3}},
             {"rotation", {kHalf, 0, 0, kHalf}}});
  gltf.node({{"camera", 1}});
  const Scene scene = loadGlb(gltf);
  ASSERT_EQ(scene.cameras.size(), 1u);
  const Camera& camera = scene.cameras[0];
  EXPECT_EQ(camera.name, "eye");
  EXPECT_VEC_NEAR(toWorld(scene, camera.position), 1, 2, 3, 1e-6);
  EXPECT_VEC_NEAR(camera.forward, 0, 1, 0, 1e-6);
  EXPECT_VEC_NEAR(camera.up, 0, 0, 1, 1e-6);
  EXPECT_EQ(camera.vertical_fov_rad, 0.75f);
  EXPECT_TRUE(warns(scene, "camera 'plan': is not a perspective camera"));
  EXPECT_EQ(findCamera(scene, "").name, "eye");
  EXPECT_THROW(findCamera(scene, "eyes"), InputError);
}

// A triangle on a node that an animation moves; loaded at `time_s` through a scene TOML.
struct Animated {
  GltfBuilder gltf;
  Animated() { gltf.triangle({0, 0, 0, 1, 0, 0, 0, 1, 0}, {{"name", "door"}}); }

  void add(const char* path, const char* interpolation, const std::vector<float>& times,
           const char* type, const std::vector<float>& values) {
    json& animation = gltf.root["animations"][0];
    animation["samplers"].push_back({{"input", gltf.floats("SCALAR", times)},
                                     {"output", gltf.floats(type, values)},
                                     {"interpolation", interpolation}});
    animation["channels"].push_back(
        {{"sampler", animation["samplers"].size() - 1}, {"target", {{"node", 0}, {"path", path}}}});
  }
  Scene at(double time_s) const {
    const TemporaryFolder folder;
    gltf.writeGltf(folder / "a.gltf");
    writeBytes(folder / "a.toml", "gltf = \"a.gltf\"\ntime_s = " + std::to_string(time_s) + "\n");
    return loadScene(folder / "a.toml");
  }
  std::string error() const {
    const TemporaryFolder folder;
    gltf.writeGltf(folder / "a.gltf");
    return loadError(folder / "a.gltf");
  }
};

TEST(GltfAnimation, LinearTranslationIsInterpolatedAndHeldAtItsEnds) {
  Animated a;
  a.add("translation", "LINEAR", {1, 3}, "VEC3", {0, 0, 0, 4, 8, 0});
  EXPECT_VEC_NEAR(corner(a.at(0), 0, 0), 0, 0, 0, 1e-6);
  EXPECT_VEC_NEAR(corner(a.at(1.5), 0, 0), 1, 2, 0, 1e-6);
  EXPECT_VEC_NEAR(corner(a.at(9), 0, 0), 4, 8, 0, 1e-6);
}

TEST(GltfAnimation, StepHoldsTheKeyBefore) {
  Animated a;
  a.add("scale", "STEP", {0, 1, 2}, "VEC3", {1, 1, 1, 2, 2, 2, 3, 3, 3});
  EXPECT_VEC_NEAR(corner(a.at(0.99), 0, 1), 1, 0, 0, 1e-6);
  EXPECT_VEC_NEAR(corner(a.at(1), 0, 1), 2, 0, 0, 1e-6);
  EXPECT_VEC_NEAR(corner(a.at(1.99), 0, 1), 2, 0, 0, 1e-6);
}

TEST(GltfAnimation, RotationTakesTheShorterArcAtConstantSpeed) {
  Animated a;
  // From 0 to 90 degrees about z, the second key negated: still 30 degrees after a third.
  const auto h = static_cast<float>(kHalf);
  a.add("rotation", "LINEAR", {0, 3}, "VEC4", {0, 0, 0, 1, 0, 0, -h, -h});
  const double c = std::cos(std::numbers::pi / 6), s = std::sin(std::numbers::pi / 6);
  EXPECT_VEC_NEAR(corner(a.at(1), 0, 1), c, s, 0, 1e-6);
}

TEST(GltfAnimation, CubicSplinesFollowTheirTangents) {
  Animated a;
  // x: 0 -> 1 over 2 s, out-tangent 3 /s, in-tangent 0. At t = 1/2:
  // 0.5 * 0 + 2 * 0.125 * 3 + 0.5 * 1 + 2 * (-0.125) * 0 = 1.25.
  a.add("translation", "CUBICSPLINE", {0, 2}, "VEC3",
        {0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0});
  EXPECT_VEC_NEAR(corner(a.at(1), 0, 0), 1.25, 0, 0, 1e-6);
  EXPECT_VEC_NEAR(corner(a.at(2), 0, 0), 1, 0, 0, 1e-6);
}

TEST(GltfAnimation, WeightsAndASecondClipAreIgnoredWithAWarning) {
  Animated a;
  a.add("translation", "LINEAR", {0}, "VEC3", {5, 0, 0});
  a.add("translation", "LINEAR", {0}, "VEC3", {9, 0, 0});
  a.add("weights", "LINEAR", {0}, "SCALAR", {1});
  const Scene scene = a.at(0);
  EXPECT_VEC_NEAR(corner(scene, 0, 0), 5, 0, 0, 1e-6);
  EXPECT_TRUE(warns(scene, "node 'door': a second animation"));
  EXPECT_TRUE(warns(scene, "animates 'weights'"));
}

TEST(GltfAnimation, BadAnimationsAreErrorsThatNameTheNode) {
  Animated unordered;
  unordered.add("translation", "LINEAR", {1, 1}, "VEC3", {0, 0, 0, 1, 1, 1});
  EXPECT_CONTAINS(unordered.error(), "animation 0, translation of node 'door': its times are not");
  Animated short_one;
  short_one.add("translation", "CUBICSPLINE", {0, 1}, "VEC3", {0, 0, 0, 1, 1, 1});
  EXPECT_CONTAINS(short_one.error(), "node 'door': has 2 keys and 2 values");
  Animated unknown;
  unknown.add("translation", "SMOOTH", {0}, "VEC3", {0, 0, 0});
  EXPECT_CONTAINS(unknown.error(), "interpolation 'SMOOTH'");
  Animated no_sampler;
  no_sampler.add("translation", "LINEAR", {0}, "VEC3", {0, 0, 0});
  no_sampler.gltf.root["animations"][0]["channels"][0]["sampler"] = 3;
  EXPECT_CONTAINS(no_sampler.error(), "names sampler 3");
  Animated zero;
  zero.add("rotation", "LINEAR", {0}, "VEC4", {0, 0, 0, 0});
  EXPECT_CONTAINS(zero.error(), "node 'door': its local transform is not finite");
  Animated matrix;
  matrix.add("translation", "LINEAR", {0}, "VEC3", {0, 0, 0});
  matrix.gltf.root["nodes"][0]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  EXPECT_CONTAINS(matrix.error(), "node 'door': is animated and has a matrix");
}

}  // namespace
}  // namespace probelab::test
