// SPDX-License-Identifier: Apache-2.0
// How a material uses a texture: plain data, without the lookup (shared/texture.h), so that buffers
// can be declared before texels can be fetched.
#ifndef PROBELAB_SHARED_TEXTURE_USE_H
#define PROBELAB_SHARED_TEXTURE_USE_H

#include "shared/ray.h"

PL_NAMESPACE_BEGIN

// The values of scene's TextureWrap.
const PL_UINT kWrapRepeat = 0u;
const PL_UINT kWrapClamp = 1u;
const PL_UINT kWrapMirror = 2u;

// A texture as one material uses it; scalar layout. width = 0: none. The rest of `flags` is 0.
struct TextureUseData {
  PL_UINT first_texel;  // texels of all textures lie in one array, row 0 first, base level first
  PL_UINT width;
  PL_UINT height;
  PL_UINT flags;        // textureFlags()
  float m00, m01, m02;  // uv' = m (u, v, 1)
  float m10, m11, m12;
};

PL_INLINE PL_UINT textureFlags(PL_UINT wrap_u, PL_UINT wrap_v, PL_UINT nearest, PL_UINT uv_set) {
  return wrap_u | (wrap_v << 2u) | (nearest << 4u) | (uv_set << 5u);
}
PL_INLINE PL_UINT textureUvSet(PL_UINT flags) { return (flags >> 5u) & 1u; }

#ifdef __cplusplus
static_assert(sizeof(TextureUseData) == 40);
#endif

PL_NAMESPACE_END

#endif
