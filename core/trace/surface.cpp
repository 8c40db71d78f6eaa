// SPDX-License-Identifier: Apache-2.0
#include "trace/surface.h"

#include <algorithm>

namespace probelab {
namespace {

TextureUseData makeUse(const TextureUse& use, const Scene& scene,
                       const std::vector<uint32_t>& first_texel) {
  TextureUseData data{};
  if (!use.used()) return data;
  const auto index = static_cast<std::size_t>(use.texture);
  const Texture& texture = scene.textures[index];
  data.first_texel = first_texel[index];
  data.width = static_cast<uint32_t>(texture.width);
  data.height = static_cast<uint32_t>(texture.height);
  data.flags = textureFlags(static_cast<uint32_t>(use.wrap_u), static_cast<uint32_t>(use.wrap_v),
                            use.nearest ? 1u : 0u, static_cast<uint32_t>(use.uv_set));
  data.m00 = use.transform[0], data.m01 = use.transform[1], data.m02 = use.transform[2];
  data.m10 = use.transform[3], data.m11 = use.transform[4], data.m12 = use.transform[5];
  return data;
}

// A point on a triangle, with what texture lookups there need.
struct Place {
  const Geometry& geometry;
  const MaterialTable& table;
  const Triangle& triangle;
  float u, v;

  Vec2f uv(uint32_t set) const {
    const auto& all = set == 0 ? geometry.uv0 : geometry.uv1;
    if (all.empty()) return {};
    return all[triangle.vertex[0]] * (1.0f - u - v) + all[triangle.vertex[1]] * u +
           all[triangle.vertex[2]] * v;
  }
  Vec4f texture(const TextureUseData& use, bool srgb) const {
    if (use.width == 0) return {1, 1, 1, 1};
    const auto fetch = [&](uint32_t index) { return table.texels[index]; };
    return sampleTexture(fetch, use, uv(textureUvSet(use.flags)), srgb);
  }
  Vec3f color(const TextureUseData& use) const {
    const Vec4f t = texture(use, true);
    return {t.x, t.y, t.z};
  }
};

Place placeAt(const Geometry& geometry, const MaterialTable& table, uint32_t triangle, float u,
              float v) {
  return {geometry, table, geometry.triangles[triangle], u, v};
}

Vec3f albedoAt(const Place& place, const MaterialData& m) {
  if (m.metallic == 0) return m.base_color * place.color(m.base_color_texture);
  const float metallic = m.metallic * place.texture(m.metallic_texture, false).z;
  return m.base_color * place.color(m.base_color_texture) * (1.0f - metallic);
}

Vec3f emissionOf(const Place& place, const MaterialData& m) {
  if (maxComponent(m.emission) == 0) return Vec3f();
  return m.emission * place.color(m.emission_texture);
}

// Twice the area times the normal; in double, since the squares of a small triangle leave fp32's
// range and those of a far one its precision.
Vec3d areaVector(const Geometry& geometry, uint32_t triangle) {
  const Triangle& t = geometry.triangles[triangle];
  const Vec3d p0(geometry.positions[t.vertex[0]]);
  return cross(Vec3d(geometry.positions[t.vertex[1]]) - p0,
               Vec3d(geometry.positions[t.vertex[2]]) - p0);
}

// Interpolated, on the side of `normal`; `normal` itself where the vertices have none.
Vec3f shadingNormal(const Place& place, const Vec3f& normal) {
  const auto& normals = place.geometry.normals;
  if (normals.empty()) return normal;
  const Vec3f sum = normals[place.triangle.vertex[0]] * (1.0f - place.u - place.v) +
                    normals[place.triangle.vertex[1]] * place.u +
                    normals[place.triangle.vertex[2]] * place.v;
  const float squared = dot(sum, sum);
  if (!(squared > 1e-12f)) return normal;  // zero vectors, or opposite ones that cancel
  const Vec3f unit = sum / std::sqrt(squared);
  return dot(unit, normal) < 0 ? -unit : unit;
}

}  // namespace

MaterialTable makeMaterialTable(const Scene& scene) {
  MaterialTable table;
  std::vector<uint32_t> first_texel;
  for (const Texture& texture : scene.textures) {
    first_texel.push_back(static_cast<uint32_t>(table.texels.size()));
    for (std::size_t i = 0; i + 3 < texture.rgba.size(); i += 4)
      table.texels.push_back(texture.rgba[i] | (uint32_t{texture.rgba[i + 1]} << 8) |
                             (uint32_t{texture.rgba[i + 2]} << 16) |
                             (uint32_t{texture.rgba[i + 3]} << 24));
  }
  for (const Material& m : scene.materials) {
    MaterialData data;
    data.base_color = m.base_color;
    data.emission = m.emission;
    data.metallic = m.metallic;
    data.base_alpha = m.base_alpha;
    data.alpha_cutoff = m.alpha_cutoff;
    data.alpha_mask = m.alpha_mask;
    data.double_sided = m.double_sided;
    data.base_color_texture = makeUse(m.base_color_texture, scene, first_texel);
    data.metallic_texture = makeUse(m.metallic_texture, scene, first_texel);
    data.emission_texture = makeUse(m.emission_texture, scene, first_texel);
    table.materials.push_back(data);
  }
  return table;
}

Vec3f faceNormal(const Geometry& geometry, uint32_t triangle) {
  return Vec3f(normalize(areaVector(geometry, triangle)));
}

float faceArea(const Geometry& geometry, uint32_t triangle) {
  return static_cast<float>(0.5 * length(areaVector(geometry, triangle)));
}

Surface surfaceAt(const Geometry& geometry, const MaterialTable& table, const Hit& hit,
                  const Vec3f& direction) {
  const Place place = placeAt(geometry, table, hit.primitive, hit.u, hit.v);
  const MaterialData& material = table.materials[place.triangle.material];
  Surface surface;
  surface.point = pointOnTriangle(geometry.positions[place.triangle.vertex[0]],
                                  geometry.positions[place.triangle.vertex[1]],
                                  geometry.positions[place.triangle.vertex[2]], hit.u, hit.v);
  const Vec3f front = faceNormal(geometry, hit.primitive);
  const bool from_behind = dot(direction, front) > 0;
  const bool flip = from_behind && material.double_sided;
  surface.geometric_normal = flip ? -front : front;
  surface.shading_normal = shadingNormal(place, surface.geometric_normal);
  surface.is_black_backface = from_behind && !material.double_sided;
  if (surface.is_black_backface) return surface;
  surface.albedo = albedoAt(place, material);
  surface.emission = emissionOf(place, material);
  return surface;
}

Vec3f emissionAt(const Geometry& geometry, const MaterialTable& table, uint32_t triangle, float u,
                 float v) {
  const Place place = placeAt(geometry, table, triangle, u, v);
  return emissionOf(place, table.materials[place.triangle.material]);
}

bool isHole(const Geometry& geometry, const MaterialTable& table, uint32_t triangle, float u,
            float v) {
  const Place place = placeAt(geometry, table, triangle, u, v);
  const MaterialData& m = table.materials[place.triangle.material];
  return m.alpha_mask &&
         m.base_alpha * place.texture(m.base_color_texture, false).w < m.alpha_cutoff;
}

}  // namespace probelab
