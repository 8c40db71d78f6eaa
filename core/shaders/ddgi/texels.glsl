// SPDX-License-Identifier: Apache-2.0
// A stored texel of an atlas. `words` is a WordArray; core/ddgi/include/ddgi/texels.h is the same
// for the host. Irradiance stays encoded; moments become mean and mean square.
#ifndef PROBELAB_DDGI_TEXELS_GLSL
#define PROBELAB_DDGI_TEXELS_GLSL

#include "ddgi/constants.h"
#include "shared/atlas_format.h"

vec3 loadIrradiance(WordArray words, uint texel) {
#if PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA32F
  return vec3(uintBitsToFloat(words.at[texel * 4u]), uintBitsToFloat(words.at[texel * 4u + 1u]),
              uintBitsToFloat(words.at[texel * 4u + 2u]));
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_RGBA16F
  uint xy = words.at[texel * 2u];
  return vec3(unpackHalfFloat(xy & 0xffffu), unpackHalfFloat(xy >> 16u),
              unpackHalfFloat(words.at[texel * 2u + 1u] & 0xffffu));
#elif PL_IRRADIANCE_FORMAT == PL_FORMAT_R11G11B10F
  return unpackR11G11B10(words.at[texel]);
#else
  return unpackRgb10A2(words.at[texel]);
#endif
}

vec2 loadMoments(WordArray words, uint texel) {
#if PL_MOMENT_FORMAT == PL_FORMAT_RG32F
  vec2 stored = vec2(uintBitsToFloat(words.at[texel * 2u]),
                     uintBitsToFloat(words.at[texel * 2u + 1u]));
#else
  uint word = words.at[texel];
  vec2 stored = vec2(unpackHalfFloat(word & 0xffffu), unpackHalfFloat(word >> 16u));
#endif
#if PL_MOMENT_ENCODING == PL_MOMENTS_CENTRAL
  return vec2(stored.x, stored.x * stored.x + stored.y * stored.y);
#else
  return stored;
#endif
}

#endif
