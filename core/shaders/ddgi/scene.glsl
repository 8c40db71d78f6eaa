// SPDX-License-Identifier: Apache-2.0
// Triangles and materials, as the shade stage and the alpha test of the ray-query tracer read them.
#ifndef PROBELAB_DDGI_SCENE_GLSL
#define PROBELAB_DDGI_SCENE_GLSL

#include "ddgi/constants.h"

struct TriangleData {
  uint vertex[3];
  uint material;
};

BUFFER(BIND_TRIANGLES, readonly, Triangles, TriangleData triangles[]);
BUFFER(BIND_POSITIONS, readonly, Positions, vec3 positions[]);
BUFFER(BIND_MATERIALS, readonly, Materials, GpuMaterial materials[]);
#if PL_SHADING_NORMALS
BUFFER(BIND_NORMALS, readonly, Normals, vec3 normals[]);
#endif
#if PL_TEXTURES
BUFFER(BIND_UV0, readonly, Uv0, vec2 uv0[]);
BUFFER(BIND_UV1, readonly, Uv1, vec2 uv1[]);
BUFFER(BIND_TEXELS, readonly, Texels, uint texels[]);
uint fetchTexel(uint index) { return texels[index]; }
#include "shared/texture.h"

vec4 sampleUse(TextureUseData use, TriangleData triangle, float u, float v, bool srgb) {
  vec2 a, b, c;
  if (textureUvSet(use.flags) == 0u) {
    a = uv0[triangle.vertex[0]], b = uv0[triangle.vertex[1]], c = uv0[triangle.vertex[2]];
  } else {
    a = uv1[triangle.vertex[0]], b = uv1[triangle.vertex[1]], c = uv1[triangle.vertex[2]];
  }
  return sampleTexture(use, a * (1.0 - u - v) + b * u + c * v, srgb);
}
#endif

// Diffuse: base colour (1 - metallic).
vec3 materialAlbedo(GpuMaterial material, TriangleData triangle, float u, float v) {
  vec3 base = material.base_color;
  float metallic = material.metallic;
#if PL_TEXTURES
  if (material.base_color_texture.width != 0u)
    base *= sampleUse(material.base_color_texture, triangle, u, v, true).rgb;
  if (material.metallic_texture.width != 0u)
    metallic *= sampleUse(material.metallic_texture, triangle, u, v, false).b;
#endif
  return base * (1.0 - metallic);
}

#if PL_EMISSION
vec3 materialEmission(GpuMaterial material, TriangleData triangle, float u, float v) {
  vec3 emission = material.emission;
#if PL_TEXTURES
  if (material.emission_texture.width != 0u)
    emission *= sampleUse(material.emission_texture, triangle, u, v, true).rgb;
#endif
  return emission;
}
#endif

#if PL_ALPHA_MASK
bool materialCutsOut(GpuMaterial material, TriangleData triangle, float u, float v) {
  if ((material.flags & kMaterialAlphaMask) == 0u) return false;
  float alpha = material.base_alpha;
#if PL_TEXTURES
  if (material.base_color_texture.width != 0u)
    alpha *= sampleUse(material.base_color_texture, triangle, u, v, true).a;
#endif
  return alpha < material.alpha_cutoff;
}
#endif

#endif
