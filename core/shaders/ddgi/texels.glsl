// SPDX-License-Identifier: Apache-2.0
// A stored texel of an atlas. `words` is a WordArray; core/ddgi/include/ddgi/texels.h is the same
// for the host. Irradiance stays encoded; moments become mean and mean square. Neither is ever
// negative, so halves are unpacked without their sign.
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
  return vec3(unpackSmallFloat(xy & 0x7fffu, 10u), unpackSmallFloat(xy >> 16u, 10u),
              unpackSmallFloat(words.at[texel * 2u + 1u] & 0x7fffu, 10u));
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
  vec2 stored = vec2(unpackSmallFloat(word & 0x7fffu, 10u), unpackSmallFloat(word >> 16u, 10u));
#endif
#if PL_MOMENT_ENCODING == PL_MOMENTS_CENTRAL
  return vec2(stored.x, stored.x * stored.x + stored.y * stored.y);
#else
  return stored;
#endif
}

#endif
