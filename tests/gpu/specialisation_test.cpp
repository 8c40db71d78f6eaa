// SPDX-License-Identifier: GPL-3.0-or-later
// A part that is switched off leaves no code in its shader: the SPIR-V without it is smaller.
#include <gtest/gtest.h>

#include <map>

#include "ddgi/scene_buffers.h"
#include "gpu/shader.h"

namespace probelab {
namespace {

using Words = std::vector<uint32_t>;

// resolve.comp.glsl with everything else as in the preset rtxgi.
Words compileResolve(const std::map<std::string, std::string>& changes) {
  Defines defines = {{"PL_FACING", "1"},
                     {"PL_TRILINEAR", "2"},
                     {"PL_VISIBILITY", "1"},
                     {"PL_CRUSH", "2"},
                     {"PL_AVERAGE", "1"},
                     {"PL_FALLBACK", "2"},
                     {"PL_MOVED", "1"},
                     {"PL_OFFSET_WEIGHTS", "1"},
                     {"PL_WALLS", "1"},
                     {"PL_PARALLAX", "1"},
                     {"PL_IRRADIANCE_FORMAT", "1"},
                     {"PL_MOMENT_FORMAT", "1"},
                     {"PL_MOMENT_ENCODING", "1"},
                     {"PL_BORDER", "0"},
                     {"PL_CHEBYSHEV_HALVES", "6"},
                     {"PL_FULL_LATTICE", "0"},
                     {"PL_INTERPOLANT", "0"},
                     {"PL_DECODE_HALVES", "5"},
                     {"PL_MOMENT_FORMAT", "1"},
                     {"PL_MOMENT_ENCODING", "1"},
                     {"PL_IRRADIANCE_TEXELS", "12"},
                     {"PL_MOMENT_FORMAT", "1"},
                     {"PL_MOMENT_ENCODING", "1"},
                     {"PL_MOMENT_TEXELS", "12"},
                     {"PL_FEEDBACK", "1"},
                     {"PL_RADIANCE_CLAMP", "1"},
                     {"PL_STORE_DISTANCES", "1"},
                     {"PL_STORE_IRRADIANCE", "0"}};
  int binding = 0;
  for (const char* input : {"FIELD", "COUNTERS", "RADIANCE", "DISTANCES"})
    defines.emplace_back(std::string("BIND_") + input, std::to_string(binding++));
  for (auto& [key, text] : defines)
    if (const auto change = changes.find(key); change != changes.end()) text = change->second;
  return compileShader({"ddgi/resolve.comp.glsl", defines, {}});
}

TEST(Specialisation, SwitchedOffPartsOfTheQueryLeaveNoCode) {
  const std::size_t full = compileResolve({}).size();
  for (const char* part :
       {"PL_FACING", "PL_VISIBILITY", "PL_CRUSH", "PL_FALLBACK", "PL_MOVED", "PL_OFFSET_WEIGHTS",
        "PL_PARALLAX",
        "PL_MOMENT_ENCODING", "PL_RADIANCE_CLAMP", "PL_STORE_DISTANCES"})
    EXPECT_LT(compileResolve({{part, "0"}}).size(), full) << part;
}

// What only a lattice's query has makes no difference to a stage for scattered probes.
TEST(Specialisation, StagesHoldOneInterpolant) {
  const auto compile = [](const char* interpolant, const std::string& name) {
    return compileResolve({{"PL_INTERPOLANT", interpolant}, {name, "0"}});
  };
  const Words scattered = compile("1", "");
  for (const char* part : {"PL_MOVED", "PL_OFFSET_WEIGHTS", "PL_TRILINEAR"}) {
    EXPECT_EQ(compile("1", part).size(), scattered.size()) << part;
    EXPECT_LT(compile("0", part).size(), compile("0", "").size()) << part;
  }
  EXPECT_LT(compile("1", "PL_WALLS").size(), scattered.size());
  EXPECT_EQ(compile("0", "PL_WALLS").size(), compile("0", "").size());
}

Words compileShade(const SceneFeatures& features) {
  Defines defines = sceneDefines(features);
  int binding = 0;
  for (const char* input : {"RAYS", "HITS", "SURFACES", "TRIANGLES", "POSITIONS", "MATERIALS",
                            "NORMALS", "UV0", "UV1", "TEXELS", "SKY", "SKY_IMAGE"})
    defines.emplace_back(std::string("BIND_") + input, std::to_string(binding++));
  return compileShader({"ddgi/shade.comp.glsl", defines, {}});
}

// SPIR-V's OpLoopMerge; an instruction's length is in the upper half of its first word.
std::size_t loopCount(const Words& words) {
  constexpr uint32_t kOpLoopMerge = 246;
  std::size_t loops = 0;
  for (std::size_t i = 5; i < words.size(); i += words[i] >> 16)
    loops += (words[i] & 0xffffu) == kOpLoopMerge ? 1 : 0;
  return loops;
}

// The query loops over the probes of a cell; nothing else in the stage loops.
TEST(Specialisation, WithoutFeedbackThereIsNoQuery) {
  EXPECT_GT(loopCount(compileResolve({})), 0u);
  EXPECT_EQ(loopCount(compileResolve({{"PL_FEEDBACK", "0"}})), 0u);
}

TEST(Specialisation, FeaturesThatASceneLacksLeaveNoCode) {
  SceneFeatures full;
  full.triangles = full.textures = full.double_sided = full.emission = true;
  full.shading_normals = full.sky = full.sky_image = true;
  const std::size_t size = compileShade(full).size();
  for (bool SceneFeatures::*feature :
       {&SceneFeatures::triangles, &SceneFeatures::textures, &SceneFeatures::double_sided,
        &SceneFeatures::emission, &SceneFeatures::shading_normals, &SceneFeatures::sky_image}) {
    SceneFeatures without = full;
    without.*feature = false;
    EXPECT_LT(compileShade(without).size(), size);
  }
}

}  // namespace
}  // namespace probelab
