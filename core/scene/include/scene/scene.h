// SPDX-License-Identifier: Apache-2.0
// The scene as every other library sees it: plain data, immutable once loaded.
//
// Positions are fp32 metres relative to `Scene::origin` (the centre of the geometry's box, in
// double), so that a scene far from the world's origin loses no precision. Whatever a person reads
// or writes is in world coordinates; toWorld and toLocal convert.
// Colours are linear Rec.709; radiance in glTF's nit, intensity in candela, irradiance in lux,
// without a 683 lm/W factor.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/vec.h"

namespace probelab {

enum class TextureWrap : uint32_t { repeat, clamp, mirror };

// 8-bit RGBA texels, row 0 first. The top-left texel is at uv (0, 0).
struct Texture {
  std::string name;
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;  // [y][x][4]
};

// A texture as one material uses it. uv' = transform * (u, v, 1) (KHR_texture_transform).
struct TextureUse {
  int texture = -1;  // index into Scene::textures; -1: none
  int uv_set = 0;    // 0 or 1
  TextureWrap wrap_u = TextureWrap::repeat, wrap_v = TextureWrap::repeat;
  bool nearest = false;  // else bilinear
  std::array<float, 6> transform = {1, 0, 0, 0, 1, 0};  // two rows
  bool used() const { return texture >= 0; }
};

// Diffuse: albedo = base colour (1 - metallic). Colour textures are sRGB, metallic is linear, in
// blue.
struct Material {
  std::string name;
  Vec3f base_color{1.0f};
  float base_alpha = 1.0f;
  float metallic = 0.0f;
  Vec3f emission;  // radiance; emissive factor times strength
  TextureUse base_color_texture, metallic_texture, emission_texture;
  bool alpha_mask = false;     // cut out where alpha < alpha_cutoff
  float alpha_cutoff = 0.5f;
  bool double_sided = false;   // else back faces are opaque, black and non-emissive
};

struct Triangle {
  uint32_t vertex[3];  // counter-clockwise seen from the front
  uint32_t material;
};

// A glTF primitive's run of triangles, for messages and reports.
struct MeshRange {
  std::string name;  // node / mesh / primitive
  uint32_t first_triangle = 0, triangle_count = 0;
};

// Attributes are per vertex and either empty (nobody has them) or as long as `positions`.
struct Geometry {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;  // unit shading normals; a zero vector means the face's own normal
  std::vector<Vec2f> uv0, uv1;
  std::vector<Triangle> triangles;
  std::vector<MeshRange> meshes;
  Box3f box;  // of all positions in use; empty without triangles
  uint32_t dropped_degenerate = 0;  // zero-area triangles left out on loading
};

enum class LightType : uint32_t { directional, point, spot };

// `intensity`: lux (directional) or candela, colour included. `direction`: the way the light
// travels.
struct Light {
  std::string name;
  LightType type = LightType::point;
  Vec3f intensity;
  Vec3f position;
  Vec3f direction{0, -1, 0};
  float cos_inner = 1.0f, cos_outer = 0.70710678f;  // spot cone
  float range = std::numeric_limits<float>::infinity();  // metres, KHR_lights_punctual
};

// Radiance of the sky in direction d: scale * (image(d), or radiance (1 + linear . d)).
struct Sky {
  Vec3f radiance;
  Vec3f linear;
  float scale = 1.0f;
  int width = 0, height = 0;
  std::vector<Vec3f> image;  // equirectangular [y][x]; empty: none
  bool black() const {
    return scale == 0 || (image.empty() && maxComponent(radiance) == 0);
  }
};

struct Camera {
  std::string name;
  Vec3f position;
  Vec3f forward{0, 0, -1}, up{0, 1, 0};  // unit, orthogonal
  float vertical_fov_rad = 0.785398f;
};

// Changes that a lighting state makes to the scene as it stands.
struct LightChange {
  std::string light;
  std::optional<Vec3f> color, position, direction;  // position in world coordinates of the file
  std::optional<float> intensity;
};
enum class Split : uint32_t { train, heldout };
struct LightingState {
  std::string name;
  Split split = Split::train;
  std::vector<LightChange> lights;
  float sky_scale = 1.0f;
};

struct FlipExposures { float start = 0, stop = 0; };  // in stops

struct Scene {
  std::string path;          // of the file that was asked for
  std::string content_hash;  // of every byte that was read
  std::string name;          // file stem, with the folder's name where it differs
  Vec3d origin;              // world position of the local origin
  std::shared_ptr<const Geometry> geometry;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<Light> lights;
  // What states start from, parallel to lights: the lights before any state, and their intensity =
  // colour times candela or lux. All empty where nothing names the colour (then states multiply).
  std::vector<Light> base_lights;
  std::vector<Vec3f> light_colors;
  std::vector<float> light_intensities;
  Sky sky;
  std::vector<Camera> cameras;
  Box3f bounds;              // where the field answers
  std::vector<Vec3f> receiver_seeds;
  std::optional<FlipExposures> flip;
  std::vector<LightingState> states;  // at least one
  std::string state;                  // the one in effect
  std::vector<std::string> warnings;  // for the user, one line each
};

inline Vec3d toWorld(const Scene& scene, const Vec3f& p) { return scene.origin + Vec3d(p); }
inline Vec3f toLocal(const Scene& scene, const Vec3d& p) { return Vec3f(p - scene.origin); }

// What a scene (in its current state) makes the renderer pay for; shaders are specialised to it.
struct SceneFeatures {
  bool triangles = false, textures = false, alpha_mask = false, double_sided = false;
  bool emission = false, shading_normals = false;
  bool sky = false, sky_linear = false, sky_image = false;
  bool directional_lights = false, point_lights = false, spot_lights = false;
};
SceneFeatures sceneFeatures(const Scene& scene);

// The scene with the named state's lights and sky; geometry and textures are shared or copied
// unchanged. Throws InputError with the nearest name when there is no such state.
Scene withState(const Scene& scene, const std::string& state_name);

// The camera of that name, or the first when the name is empty. Throws InputError.
const Camera& findCamera(const Scene& scene, const std::string& name);

}  // namespace probelab
