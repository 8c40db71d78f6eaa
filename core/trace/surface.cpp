// SPDX-License-Identifier: Apache-2.0
#include "trace/surface.h"

#include <algorithm>
#include <cmath>

namespace probelab {
namespace {

// Where the copy of each texture starts that is filtered as colour, and as numbers.
struct FirstTexels {
  std::vector<uint32_t> color, metallic;
};

// One level of a texture, decoded.
struct Level {
  int width, height;
  std::vector<Vec4f> texels;
};

// Rounded to the nearest 8-bit texel; the inverse of decodeTexel.
uint32_t encodeTexel(const Vec4f& value, bool srgb) {
  const auto byte = [](double x) { return static_cast<uint32_t>(std::lround(255 * x)); };
  const auto color = [&](double x) {
    if (!srgb) return byte(x);
    return byte(x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055);
  };
  return color(value.x) | (color(value.y) << 8) | (color(value.z) << 16) | (byte(value.w) << 24);
}

// The next coarser level of width x height texels at(x, y). A texel's share in a coarser one is the
// overlap of their stretches, in whole units of 1 / (width next.width).
template <class At>
Level halve(int width, int height, const At& at) {
  Level next{std::max(width / 2, 1), std::max(height / 2, 1), {}};
  const float weight_sum = static_cast<float>(width) * static_cast<float>(height);
  const auto overlap = [](int i, int coarse_i, int size, int coarse_size) {
    return static_cast<float>(std::min((i + 1) * coarse_size, (coarse_i + 1) * size) -
                              std::max(i * coarse_size, coarse_i * size));
  };
  for (int y = 0; y < next.height; ++y)
    for (int x = 0; x < next.width; ++x) {
      Vec4f sum{};
      for (int j = y * height / next.height; j * next.height < (y + 1) * height; ++j)
        for (int i = x * width / next.width; i * next.width < (x + 1) * width; ++i)
          sum = sum +
                at(i, j) * (overlap(i, x, width, next.width) * overlap(j, y, height, next.height));
      next.texels.push_back(sum * (1 / weight_sum));
    }
  return next;
}

void appendBase(const Texture& texture, std::vector<uint32_t>& texels) {
  for (std::size_t i = 0; i + 3 < texture.rgba.size(); i += 4)
    texels.push_back(texture.rgba[i] | (uint32_t{texture.rgba[i + 1]} << 8) |
                     (uint32_t{texture.rgba[i + 2]} << 16) | (uint32_t{texture.rgba[i + 3]} << 24));
}

// Levels are made of unrounded ones: roundings do not add up on the way to the coarsest.
void appendWithLevels(const Texture& texture, bool srgb, std::vector<uint32_t>& texels) {
  const std::size_t first = texels.size();
  appendBase(texture, texels);
  int width = texture.width, height = texture.height;
  Level level{};
  while (width * height > 1) {
    const auto index = [&](int x, int y) { return static_cast<std::size_t>(y * width + x); };
    level =
        level.texels.empty()
            ? halve(width, height,
                    [&](int x, int y) { return decodeTexel(texels[first + index(x, y)], srgb); })
            : halve(width, height, [&](int x, int y) { return level.texels[index(x, y)]; });
    width = level.width, height = level.height;
    for (const Vec4f& texel : level.texels) texels.push_back(encodeTexel(texel, srgb));
  }
}

FirstTexels appendTextures(const Scene& scene, TextureLevels levels,
                           std::vector<uint32_t>& texels) {
  std::vector<bool> is_color(scene.textures.size()), is_metallic(scene.textures.size());
  const auto mark = [](const TextureUse& use, std::vector<bool>& marks) {
    if (use.used()) marks[static_cast<std::size_t>(use.texture)] = true;
  };
  for (const Material& m : scene.materials) {
    mark(m.base_color_texture, is_color);
    mark(m.emission_texture, is_color);
    mark(m.metallic_texture, is_metallic);
  }
  FirstTexels first;
  for (std::size_t i = 0; i < scene.textures.size(); ++i) {
    const Texture& texture = scene.textures[i];
    const auto end = [&] { return static_cast<uint32_t>(texels.size()); };
    const bool all = levels == TextureLevels::all;
    first.color.push_back(end());
    first.metallic.push_back(end());
    if (all && is_color[i]) {
      appendWithLevels(texture, true, texels);
      first.metallic.back() = end();
    }
    if (all && is_metallic[i]) appendWithLevels(texture, false, texels);
    if (!all || (!is_color[i] && !is_metallic[i])) appendBase(texture, texels);
  }
  return first;
}

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

MaterialTable makeMaterialTable(const Scene& scene, TextureLevels levels) {
  MaterialTable table;
  const FirstTexels first = appendTextures(scene, levels, table.texels);
  for (const Material& m : scene.materials) {
    MaterialData data;
    data.base_color = m.base_color;
    data.emission = m.emission;
    data.metallic = m.metallic;
    data.base_alpha = m.base_alpha;
    data.alpha_cutoff = m.alpha_cutoff;
    data.alpha_mask = m.alpha_mask;
    data.double_sided = m.double_sided;
    data.base_color_texture = makeUse(m.base_color_texture, scene, first.color);
    data.metallic_texture = makeUse(m.metallic_texture, scene, first.metallic);
    data.emission_texture = makeUse(m.emission_texture, scene, first.color);
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
