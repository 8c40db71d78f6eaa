// SPDX-License-Identifier: Apache-2.0
// Queries on a loaded scene.
#include "scene/scene.h"

#include <algorithm>

#include "base/error.h"
#include "base/suggest.h"
#include "warnings.h"

namespace probelab {
namespace {

struct Source {
  Vec3f color{1.0f};
  float intensity = 0;
};

// Scenes that were put together by hand may name no colours: the brightest channel is taken as the
// intensity then.
Source sourceOf(const Scene& scene, const std::vector<Light>& base, std::size_t i) {
  if (scene.light_colors.size() == base.size() && scene.light_intensities.size() == base.size())
    return {scene.light_colors[i], scene.light_intensities[i]};
  const float peak = maxComponent(base[i].intensity);
  if (!(peak > 0)) return {};
  return {base[i].intensity / peak, peak};
}

void applyChange(const Scene& scene, const LightChange& change, Source source, Light& light) {
  light.intensity =
      change.color.value_or(source.color) * change.intensity.value_or(source.intensity);
  if (change.position) light.position = toLocal(scene, Vec3d(*change.position));
  if (change.direction) light.direction = *change.direction;
}

template <class List, class NameOf>
std::vector<std::string> namesOf(const List& list, NameOf name_of) {
  std::vector<std::string> names;
  for (const auto& item : list) names.push_back(name_of(item));
  return names;
}

void addTextureFeatures(const Material& m, SceneFeatures& f) {
  f.textures = f.textures || m.base_color_texture.used() || m.metallic_texture.used() ||
               m.emission_texture.used();
  f.alpha_mask = f.alpha_mask || m.alpha_mask;
  f.double_sided = f.double_sided || m.double_sided;
  f.emission = f.emission || maxComponent(m.emission) > 0;
}

}  // namespace

SceneFeatures sceneFeatures(const Scene& scene) {
  SceneFeatures f;
  if (scene.geometry) {
    const Geometry& g = *scene.geometry;
    f.triangles = !g.triangles.empty();
    f.shading_normals = std::any_of(g.normals.begin(), g.normals.end(),
                                    [](const Vec3f& n) { return dot(n, n) > 0; });
    std::vector<bool> used(scene.materials.size());
    for (const Triangle& t : g.triangles) used[t.material] = true;
    for (std::size_t i = 0; i < used.size(); ++i)
      if (used[i]) addTextureFeatures(scene.materials[i], f);
  }
  f.sky = !scene.sky.black();
  f.sky_image = f.sky && !scene.sky.image.empty();
  f.sky_linear = f.sky && !f.sky_image && dot(scene.sky.linear, scene.sky.linear) > 0;
  for (const Light& light : scene.lights) {
    if (!(maxComponent(light.intensity) > 0)) continue;
    f.directional_lights = f.directional_lights || light.type == LightType::directional;
    f.point_lights = f.point_lights || light.type == LightType::point;
    f.spot_lights = f.spot_lights || light.type == LightType::spot;
  }
  return f;
}

Scene withState(const Scene& scene, const std::string& state_name) {
  const auto state = std::find_if(scene.states.begin(), scene.states.end(),
                                  [&](const LightingState& s) { return s.name == state_name; });
  if (state == scene.states.end())
    throwInput("{}: no lighting state '{}'{}", scene.path, printable(state_name),
               suggestion(state_name,
                          namesOf(scene.states, [](const LightingState& s) { return s.name; })));
  Scene result = scene;
  // States do not add up: each one starts from the scene as its files have it.
  const std::vector<Light>& base =
      scene.base_lights.size() == scene.lights.size() ? scene.base_lights : scene.lights;
  result.lights = base;
  result.state = state->name;
  result.sky.scale = state->sky_scale;
  for (const LightChange& change : state->lights)
    for (std::size_t i = 0; i < base.size(); ++i)
      if (base[i].name == change.light)
        applyChange(scene, change, sourceOf(scene, base, i), result.lights[i]);
  return result;
}

const Camera& findCamera(const Scene& scene, const std::string& name) {
  if (scene.cameras.empty())
    throwInput("{}: has no camera; add a [[camera]] to its scene TOML (`probelab init` writes one)",
               scene.path);
  if (name.empty()) return scene.cameras.front();
  for (const Camera& camera : scene.cameras)
    if (camera.name == name) return camera;
  throwInput("{}: no camera '{}'{}", scene.path, printable(name),
             suggestion(name, namesOf(scene.cameras, [](const Camera& c) { return c.name; })));
}

}  // namespace probelab
