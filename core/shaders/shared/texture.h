// SPDX-License-Identifier: Apache-2.0
// Texture lookups as both renderers do them: wrap, nearest or bilinear, sRGB decoded before
// filtering. The path tracer and alpha tests see the base level; probe rays may see the mean over
// their footprint. Plain float; included by core/trace and by the shade stage.
//
// The includer supplies the texels: in GLSL `uint fetchTexel(uint index)`, declared before the
// include; in C++ any callable, passed first. A texel holds 8-bit r, g, b, a from the lowest byte.
#ifndef PROBELAB_SHARED_TEXTURE_H
#define PROBELAB_SHARED_TEXTURE_H

#include "shared/texture_use.h"

#ifdef __cplusplus
#define PL_FLOAT2 Vec2f
#define PL_FLOAT4 Vec4f
#define PL_TEXEL_FUNCTION     \
  template <class FetchTexel> \
  inline
#define PL_TEXEL_SOURCE const FetchTexel &fetchTexel,
#define PL_TEXEL_PASS fetchTexel,
#else
#define PL_FLOAT2 vec2
#define PL_FLOAT4 vec4
#define PL_TEXEL_FUNCTION
#define PL_TEXEL_SOURCE
#define PL_TEXEL_PASS
#endif

PL_NAMESPACE_BEGIN

// IEC 61966-2-1. c^2.4 = c^2 c^0.4 with the fifth root of c^2 by Newton's method: products and
// quotients only, so that both languages agree to a few units in the last place (Vulkan's pow does
// not). The start is within 2 % on [0.09, 1], which three steps turn into rounding error.
#ifdef __cplusplus
constexpr
#endif
    float
    srgbToLinear(float s) {
  if (s <= 0.04045f) return s * (1.0f / 12.92f);
  const float c = (s + 0.055f) * (1.0f / 1.055f);
  const float square = c * c;
  float root = 0.2923f + c * (1.1105f - 0.4084f * c);
  for (int i = 0; i < 3; ++i) {
    const float r2 = root * root;
    root = 0.2f * (4.0f * root + square / (r2 * r2));
  }
  return square * root;
}

#ifdef __cplusplus
struct SrgbTable {
  float linear[256] = {};
  constexpr SrgbTable() {
    for (int i = 0; i < 256; ++i) linear[i] = srgbToLinear(static_cast<float>(i) * (1.0f / 255.0f));
  }
};
inline constexpr SrgbTable kSrgbTable;
inline float srgbByte(PL_UINT byte_value) { return kSrgbTable.linear[byte_value]; }
#else
float srgbByte(uint byte_value) { return srgbToLinear(float(byte_value) * (1.0f / 255.0f)); }
#endif

// Colour decoded if `srgb`, alpha always linear.
PL_INLINE PL_FLOAT4 decodeTexel(PL_UINT texel, bool srgb) {
  const PL_UINT r = texel & 255u;
  const PL_UINT g = (texel >> 8u) & 255u;
  const PL_UINT b = (texel >> 16u) & 255u;
  const float a = float(texel >> 24u) * (1.0f / 255.0f);
  if (srgb) return PL_FLOAT4(srgbByte(r), srgbByte(g), srgbByte(b), a);
  const float scale = 1.0f / 255.0f;
  return PL_FLOAT4(float(r) * scale, float(g) * scale, float(b) * scale, a);
}

// Into [0, 1]; the fold of kWrapMirror included.
PL_INLINE float wrapCoordinate(float x, PL_UINT mode) {
  if (mode == kWrapClamp) return clamp(x, 0.0f, 1.0f);
  if (mode == kWrapMirror) return 1.0f - abs(x - 2.0f * floor(0.5f * x) - 1.0f);
  return x - floor(x);
}

// Texel index of i in [-1, size]: a folded or clamped neighbour is the edge texel itself.
PL_INLINE int wrapTexel(int i, int size, PL_UINT mode) {
  if (mode == kWrapRepeat) return i < 0 ? i + size : (i >= size ? i - size : i);
  return i < 0 ? 0 : (i >= size ? size - 1 : i);
}

PL_TEXEL_FUNCTION PL_FLOAT4 texelAt(PL_TEXEL_SOURCE PL_CONST_IN(TextureUseData) use, int x, int y,
                                    bool srgb) {
  const int w = int(use.width);
  const int ix = wrapTexel(x, w, use.flags & 3u);
  const int iy = wrapTexel(y, int(use.height), (use.flags >> 2u) & 3u);
  return decodeTexel(fetchTexel(use.first_texel + PL_UINT(iy * w + ix)), srgb);
}

// The texture at uv (before its transform). use.width must not be 0.
PL_TEXEL_FUNCTION PL_FLOAT4 sampleTexture(PL_TEXEL_SOURCE PL_CONST_IN(TextureUseData) use,
                                          PL_FLOAT2 uv, bool srgb) {
  const float u = use.m00 * uv.x + use.m01 * uv.y + use.m02;
  const float v = use.m10 * uv.x + use.m11 * uv.y + use.m12;
  const float x = wrapCoordinate(u, use.flags & 3u) * float(use.width);
  const float y = wrapCoordinate(v, (use.flags >> 2u) & 3u) * float(use.height);
  if (((use.flags >> 4u) & 1u) != 0u) {
    const int nx = min(floorToInt(x), int(use.width) - 1);
    const int ny = min(floorToInt(y), int(use.height) - 1);
    return texelAt(PL_TEXEL_PASS use, nx, ny, srgb);
  }
  const int x0 = floorToInt(x - 0.5f);
  const int y0 = floorToInt(y - 0.5f);
  const float fx = (x - 0.5f) - float(x0);
  const float fy = (y - 0.5f) - float(y0);
  const PL_FLOAT4 t00 = texelAt(PL_TEXEL_PASS use, x0, y0, srgb);
  const PL_FLOAT4 t10 = texelAt(PL_TEXEL_PASS use, x0 + 1, y0, srgb);
  const PL_FLOAT4 t01 = texelAt(PL_TEXEL_PASS use, x0, y0 + 1, srgb);
  const PL_FLOAT4 t11 = texelAt(PL_TEXEL_PASS use, x0 + 1, y0 + 1, srgb);
  return (t00 * (1.0f - fx) + t10 * fx) * (1.0f - fy) + (t01 * (1.0f - fx) + t11 * fx) * fy;
}

// How many times a ray's footprint holds the triangle it hit. The disc that the cone cuts out at
// right angles to the ray, cone_area t^2, is seen under the same angle as the footprint; so is the
// triangle's projection along the ray, half of |area_vector . direction| (area_vector = the cross
// product of two edges). A ratio of areas that no affine map changes, uv coordinates included.
// With cone_area = 4 pi / R the footprint is the reciprocal of the hits' density, so that those of
// R rays cover a surface once. (Ray cones take the footprint's longer side, which is larger by 1 /
// sqrt(cos) and blurs more at grazing angles: Akenine-Moeller et al. 2021, "Improved shader and
// texture level of detail using ray cones".)
PL_INLINE float footprintTriangles(float cone_area, float distance,
                                   PL_CONST_IN(PL_FLOAT3) area_vector,
                                   PL_CONST_IN(PL_FLOAT3) direction) {
  const float projected = 0.5f * abs(dot(area_vector, direction));
  return cone_area * distance * distance / max(projected, 1e-30f);
}

// The next coarser level, which follows in the array of texels: half the size, rounded down, and at
// least 1.
PL_INLINE TextureUseData coarserLevel(PL_CONST_IN(TextureUseData) use) {
  TextureUseData next = use;
  next.first_texel = use.first_texel + use.width * use.height;
  next.width = max(use.width / 2u, 1u);
  next.height = max(use.height / 2u, 1u);
  return next;
}

// The texture's mean over a footprint around uv; `uv_area` is its area in uv before the transform.
// The texture must have all its levels. Of two levels with N and M texels, where a footprint covers
// the share c of the texture, the finer is read up to N M c^2 = 1: the level that is nearest in the
// log of a texel's area, for every size and shape; about 2 texels for the base, and the coarsest
// from c = 1 at the latest. Blending two levels would cost twice the fetches and leave noise 1.08
// times less variance (the mean over log c of one level's c N, which goes from 1/2 to 2).
PL_TEXEL_FUNCTION PL_FLOAT4 sampleFootprint(PL_TEXEL_SOURCE PL_CONST_IN(TextureUseData) use,
                                            PL_FLOAT2 uv, float uv_area, bool srgb) {
  const float c = min(uv_area * abs(use.m00 * use.m11 - use.m01 * use.m10), 4.0f);
  TextureUseData level = use;
  while (level.width * level.height > 1u) {
    const TextureUseData next = coarserLevel(level);
    const float both = float(level.width * level.height) * float(next.width * next.height);
    if (both * c * c <= 1.0f) break;
    level = next;
  }
  return sampleTexture(PL_TEXEL_PASS level, uv, srgb);
}

PL_NAMESPACE_END

#endif
