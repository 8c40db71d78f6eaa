// SPDX-License-Identifier: Apache-2.0
// What lies at a hit: position with its error, normals, albedo and emission, by the rules that the
// shade stage shares. Back faces of single-sided materials are opaque, black and do not emit.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/scene.h"
#include "shared/offset.h"
#include "shared/ray.h"
#include "shared/texture.h"

namespace probelab {

// A material ready to be evaluated: factors multiplied out, textures in one array of texels.
struct MaterialData {
  Vec3f base_color, emission;
  float metallic = 0, base_alpha = 1, alpha_cutoff = 0;
  bool alpha_mask = false, double_sided = false;
  TextureUseData base_color_texture{}, metallic_texture{}, emission_texture{};
};

// Materials and texels of a scene; independent of the Scene it was made from.
struct MaterialTable {
  std::vector<MaterialData> materials;
  std::vector<uint32_t> texels;  // r, g, b, a from the lowest byte; all textures, in their order
};

// `all` puts behind each texture its coarser levels, for sampleFootprint() (a third more texels).
// A level halves the one before, sizes rounded down and at least 1, to 1 x 1: each texel is the
// mean of the stretch of texture that it covers, in linear light (colours) or as stored (metallic,
// alpha), rounded to 8 bits. Every level tiles the unit square, so that wrapping holds in all. A
// texture that serves as colour and as metallic is there twice.
enum class TextureLevels { base, all };
MaterialTable makeMaterialTable(const Scene& scene, TextureLevels levels = TextureLevels::base);

// All vectors in local coordinates, normals of unit length.
struct Surface {
  BoundedPoint point;      // position and the bound of its rounding error
  Vec3f geometric_normal;  // the front side; of a double-sided material the side that was hit
  Vec3f shading_normal;    // on the geometric normal's side; for cosines only
  Vec3f albedo;            // base colour (1 - metallic)
  Vec3f emission;          // radiance leaving towards the ray's origin
  bool is_black_backface = false;  // then albedo and emission are 0
};

// `hit` must be a hit; `direction` is the ray's.
Surface surfaceAt(const Geometry& geometry, const MaterialTable& table, const Hit& hit,
                  const Vec3f& direction);

// Counter-clockwise normal of a triangle; unit length (zero-area triangles are not in a Scene).
Vec3f faceNormal(const Geometry& geometry, uint32_t triangle);
float faceArea(const Geometry& geometry, uint32_t triangle);  // square metres

// Emitted radiance of the front side at a point of a triangle (weights as in Hit).
Vec3f emissionAt(const Geometry& geometry, const MaterialTable& table, uint32_t triangle, float u,
                 float v);

// Whether an alpha-masked material has a hole at that point.
bool isHole(const Geometry& geometry, const MaterialTable& table, uint32_t triangle, float u,
            float v);

}  // namespace probelab
