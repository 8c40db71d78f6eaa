// SPDX-License-Identifier: Apache-2.0
// Storage formats of the atlases, packed and unpacked by integer arithmetic: the same bits on every
// device and in C++, rounding to nearest even (image stores may truncate). Values saturate at the
// format's largest finite number; negative values become 0 in the unsigned formats.
#ifndef PROBELAB_SHARED_ATLAS_FORMAT_H
#define PROBELAB_SHARED_ATLAS_FORMAT_H

#include "shared/ray.h"

PL_NAMESPACE_BEGIN

// Irradiance formats.
#define PL_FORMAT_RGBA32F 0
#define PL_FORMAT_RGBA16F 1
#define PL_FORMAT_R11G11B10F 2
#define PL_FORMAT_RGB10A2 3
// Moment formats.
#define PL_FORMAT_RG32F 0
#define PL_FORMAT_RG16F 1

// Magnitude of x >= 0 as a float with 5 exponent bits (bias 15) and `mantissa_bits` (10, 6, 5).
PL_INLINE uint packSmallFloat(float x, uint mantissa_bits) {
  uint bits = floatBitsToUint(x) & 0x7fffffffu;  // -0 is 0
  uint shift = 23u - mantissa_bits;
  uint largest = (30u << mantissa_bits) | ((1u << mantissa_bits) - 1u);
  if (bits >= 0x7f800000u) return largest;
  if (bits < 0x38800000u) {
    // Below the smallest normal: adding this power of two rounds at the format's last place.
    uint magic = (136u - mantissa_bits) << 23u;
    return floatBitsToUint(uintBitsToFloat(bits) + uintBitsToFloat(magic)) - magic;
  }
  uint rounded = bits + ((1u << (shift - 1u)) - 1u) + ((bits >> shift) & 1u) - (112u << 23u);
  return min(rounded >> shift, largest);
}

PL_INLINE float unpackSmallFloat(uint bits, uint mantissa_bits) {
  return uintBitsToFloat(bits << (23u - mantissa_bits)) * 5.192296858534828e33f;  // 2^112
}

PL_INLINE uint packHalfFloat(float x) {
  uint sign = (floatBitsToUint(x) >> 16u) & 0x8000u;
  return sign | packSmallFloat(abs(x), 10u);
}

PL_INLINE float unpackHalfFloat(uint bits) {
  float magnitude = unpackSmallFloat(bits & 0x7fffu, 10u);
  return (bits & 0x8000u) != 0u ? -magnitude : magnitude;
}

PL_INLINE uint packHalfPair(float x, float y) {
  return packHalfFloat(x) | (packHalfFloat(y) << 16u);
}

PL_INLINE uint packR11G11B10(PL_FLOAT3 c) {
  return packSmallFloat(max(c.x, 0.0f), 6u) | (packSmallFloat(max(c.y, 0.0f), 6u) << 11u) |
         (packSmallFloat(max(c.z, 0.0f), 5u) << 22u);
}

PL_INLINE PL_FLOAT3 unpackR11G11B10(uint bits) {
  return PL_FLOAT3(unpackSmallFloat(bits & 0x7ffu, 6u),
                       unpackSmallFloat((bits >> 11u) & 0x7ffu, 6u),
                       unpackSmallFloat(bits >> 22u, 5u));
}

PL_INLINE uint packUnorm10(float x) {
  return uint(floor(clamp(x, 0.0f, 1.0f) * 1023.0f + 0.5f));
}

PL_INLINE uint packRgb10A2(PL_FLOAT3 c) {
  return packUnorm10(c.x) | (packUnorm10(c.y) << 10u) | (packUnorm10(c.z) << 20u);
}

PL_INLINE PL_FLOAT3 unpackRgb10A2(uint bits) {
  return PL_FLOAT3(float(bits & 0x3ffu), float((bits >> 10u) & 0x3ffu),
                       float((bits >> 20u) & 0x3ffu)) * (1.0f / 1023.0f);
}

// 32-bit words a texel takes.
PL_INLINE uint irradianceWords(int format) {
  return format == PL_FORMAT_RGBA32F ? 4u : (format == PL_FORMAT_RGBA16F ? 2u : 1u);
}
PL_INLINE uint momentWords(int format) { return format == PL_FORMAT_RG32F ? 2u : 1u; }

PL_NAMESPACE_END

#endif
