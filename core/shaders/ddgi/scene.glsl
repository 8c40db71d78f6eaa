// SPDX-License-Identifier: Apache-2.0
// Triangles and materials, as the shade stage and the alpha test of the ray-query tracer read them.
// Before it, the stage declares a block `push` with a member `SceneAddresses scene`.
#ifndef PROBELAB_DDGI_SCENE_GLSL
#define PROBELAB_DDGI_SCENE_GLSL

#include "ddgi/constants.h"

// 1: textures have all levels, and shading reads the one that fits the ray's footprint. Alpha tests
// read the base level in any case.
#ifndef PL_TEXTURE_LOD
#define PL_TEXTURE_LOD 0
#endif

#if PL_TEXTURES
uint fetchTexel(uint index) { return push.scene.texels.at[index]; }
#include "shared/texture.h"

void triangleUv(TextureUseData use, TriangleData triangle, out vec2 a, out vec2 b, out vec2 c) {
  if (textureUvSet(use.flags) == 0u) {
    a = push.scene.uv0.at[triangle.vertex[0]];
    b = push.scene.uv0.at[triangle.vertex[1]];
    c = push.scene.uv0.at[triangle.vertex[2]];
  } else {
    a = push.scene.uv1.at[triangle.vertex[0]];
    b = push.scene.uv1.at[triangle.vertex[1]];
    c = push.scene.uv1.at[triangle.vertex[2]];
  }
}

vec4 sampleBase(TextureUseData use, TriangleData triangle, float u, float v, bool srgb) {
  vec2 a, b, c;
  triangleUv(use, triangle, a, b, c);
  return sampleTexture(use, a * (1.0 - u - v) + b * u + c * v, srgb);
}

vec4 sampleUse(TextureUseData use, TriangleData triangle, float u, float v, float footprint,
               bool srgb) {
#if PL_TEXTURE_LOD
  vec2 a, b, c;
  triangleUv(use, triangle, a, b, c);
  vec2 ab = b - a, ac = c - a;
  float uv_area = footprint * 0.5 * abs(ab.x * ac.y - ab.y * ac.x);
  return sampleFootprint(use, a * (1.0 - u - v) + b * u + c * v, uv_area, srgb);
#else
  return sampleBase(use, triangle, u, v, srgb);
#endif
}
#endif

// Diffuse: base colour (1 - metallic). `footprint`: footprintTriangles() of the ray, read with
// PL_TEXTURE_LOD alone.
vec3 materialAlbedo(GpuMaterial material, TriangleData triangle, float u, float v,
                    float footprint) {
  vec3 base = material.base_color;
  float metallic = material.metallic;
#if PL_TEXTURES
  if (material.base_color_texture.width != 0u)
    base *= sampleUse(material.base_color_texture, triangle, u, v, footprint, true).rgb;
  if (material.metallic_texture.width != 0u)
    metallic *= sampleUse(material.metallic_texture, triangle, u, v, footprint, false).b;
#endif
  return base * (1.0 - metallic);
}

#if PL_EMISSION
vec3 materialEmission(GpuMaterial material, TriangleData triangle, float u, float v,
                      float footprint) {
  vec3 emission = material.emission;
#if PL_TEXTURES
  if (material.emission_texture.width != 0u)
    emission *= sampleUse(material.emission_texture, triangle, u, v, footprint, true).rgb;
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
    alpha *= sampleBase(material.base_color_texture, triangle, u, v, true).a;
#endif
  return alpha < material.alpha_cutoff;
}
#endif

#endif
