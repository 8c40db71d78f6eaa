// SPDX-License-Identifier: Apache-2.0
// Stored texels -> floats on the host and back, by the arithmetic that the shaders use.
#pragma once

#include <cstddef>
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

// The words of an encoded value, rounded to nearest.
inline void packIrradiance(int format, const Vec3f& value, uint32_t* words) {
  switch (format) {
    case PL_FORMAT_RGBA32F:
      for (std::size_t c = 0; c < 3; ++c) words[c] = floatBitsToUint(value[c]);
      words[3] = 0;
      return;
    case PL_FORMAT_RGBA16F:
      words[0] = packHalfPair(value.x, value.y, kRoundToNearest);
      words[1] = packHalfFloat(value.z, kRoundToNearest);
      return;
    case PL_FORMAT_R11G11B10F:
      words[0] = packR11G11B10(value, kRoundToNearest);
      return;
    default:
      words[0] = packRgb10A2(value, kRoundToNearest);
  }
}

// The largest number that all channels of a format hold.
inline float largestIrradiance(int format) {
  switch (format) {
    case PL_FORMAT_RGBA32F:
      return 3.4e38f;
    case PL_FORMAT_RGBA16F:
      return 65504.0f;
    case PL_FORMAT_R11G11B10F:
      return 64512.0f;
    default:
      return 1.0f;
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
