// SPDX-License-Identifier: Apache-2.0
// Stored texels -> floats on the host, by the arithmetic that the shaders use.
#pragma once

#include <cstdint>

#include "shared/atlas_format.h"
#include "shared/query_params.h"

namespace probelab {

// `words` points to irradianceWords(format) words; the value is still encoded.
inline Vec3f unpackIrradiance(int format, const uint32_t* words) {
  switch (format) {
    case PL_FORMAT_RGBA32F:
      return {uintBitsToFloat(words[0]), uintBitsToFloat(words[1]), uintBitsToFloat(words[2])};
    case PL_FORMAT_RGBA16F:
      return {unpackHalfFloat(words[0] & 0xffffu), unpackHalfFloat(words[0] >> 16),
              unpackHalfFloat(words[1] & 0xffffu)};
    case PL_FORMAT_R11G11B10F:
      return unpackR11G11B10(words[0]);
    default:
      return unpackRgb10A2(words[0]);
  }
}

// Mean and mean square of the distance; `encoding` is PL_MOMENTS_*.
inline Vec2f unpackMoments(int format, int encoding, const uint32_t* words) {
  Vec2f stored(unpackHalfFloat(words[0] & 0xffffu), unpackHalfFloat(words[0] >> 16));
  if (format == PL_FORMAT_RG32F) stored = {uintBitsToFloat(words[0]), uintBitsToFloat(words[1])};
  if (encoding == PL_MOMENTS_RAW) return stored;
  return {stored.x, stored.x * stored.x + stored.y * stored.y};
}

}  // namespace probelab
