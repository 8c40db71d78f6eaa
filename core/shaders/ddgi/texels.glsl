// SPDX-License-Identifier: Apache-2.0
// A stored texel of an atlas, still encoded. `words` is the buffer's array (buffers cannot be passed
// to functions); core/ddgi/include/ddgi/texels.h is the same for the host.
#ifndef PROBELAB_DDGI_TEXELS_GLSL
#define PROBELAB_DDGI_TEXELS_GLSL

#include "shared/atlas_format.h"

#if PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA32F
#define LOAD_IRRADIANCE(words, texel)                  \
  vec3(uintBitsToFloat(words[(texel) * 4u]),           \
       uintBitsToFloat(words[(texel) * 4u + 1u]),      \
       uintBitsToFloat(words[(texel) * 4u + 2u]))
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA16F
#define LOAD_IRRADIANCE(words, texel)                  \
  vec3(unpackHalfFloat(words[(texel) * 2u] & 0xffffu), \
       unpackHalfFloat(words[(texel) * 2u] >> 16u),    \
       unpackHalfFloat(words[(texel) * 2u + 1u] & 0xffffu))
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_R11G11B10F
#define LOAD_IRRADIANCE(words, texel) unpackR11G11B10(words[texel])
#else
#define LOAD_IRRADIANCE(words, texel) unpackRgb10A2(words[texel])
#endif

#if PL_MOMENT_FORMAT == PL_FORMAT_RG32F
#define LOAD_MOMENTS(words, texel) \
  vec2(uintBitsToFloat(words[(texel) * 2u]), uintBitsToFloat(words[(texel) * 2u + 1u]))
#else
#define LOAD_MOMENTS(words, texel) \
  vec2(unpackHalfFloat(words[texel] & 0xffffu), unpackHalfFloat(words[texel] >> 16u))
#endif

#endif
