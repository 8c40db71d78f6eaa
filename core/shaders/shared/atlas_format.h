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

// A number in [0, 2^32) by which a value is rounded: up where it is below the part that is cut off,
// in units of 2^-32 of the format's last place. kRoundToNearest takes the nearest instead (ties to
// even); random numbers make the expected value the value itself (dithering).
const uint kRoundToNearest = 0xffffffffu;

// Independent numbers for a texel, one a channel, from any 32 bits (Jarzynski and Olano, JCGT 9(3),
// 2020: pcg). Never kRoundToNearest.
PL_INLINE uint ditherHash(uint v) {
  uint state = v * 747796405u + 2891336453u;
  uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
  return min((word >> 22u) ^ word, 0xfffffffeu);
}

// Magnitude of x >= 0 as a float with 5 exponent bits (bias 15) and `mantissa_bits` (10, 6, 5).
PL_INLINE uint packSmallFloat(float x, uint mantissa_bits, uint rounding) {
  uint bits = floatBitsToUint(x) & 0x7fffffffu;  // -0 is 0
  uint shift = 23u - mantissa_bits;
  uint largest = (30u << mantissa_bits) | ((1u << mantissa_bits) - 1u);
  if (bits >= 0x7f800000u) return largest;
  if (bits < 0x38800000u) {
    // Below the smallest normal the format's last place is 2^-(14 + mantissa_bits).
    if (rounding != kRoundToNearest) {
      float units = uintBitsToFloat(bits) * uintBitsToFloat((141u + mantissa_bits) << 23u);
      return uint(floor(units + float(rounding >> 8u) * (1.0f / 16777216.0f)));
    }
    // Adding this power of two rounds at that place.
    uint magic = (136u - mantissa_bits) << 23u;
    return floatBitsToUint(uintBitsToFloat(bits) + uintBitsToFloat(magic)) - magic;
  }
  uint step = rounding == kRoundToNearest ? ((1u << (shift - 1u)) - 1u) + ((bits >> shift) & 1u)
                                          : rounding >> (32u - shift);
  return min((bits + step - (112u << 23u)) >> shift, largest);
}

PL_INLINE float unpackSmallFloat(uint bits, uint mantissa_bits) {
  return uintBitsToFloat(bits << (23u - mantissa_bits)) * 5.192296858534828e33f;  // 2^112
}

PL_INLINE uint packHalfFloat(float x, uint rounding) {
  uint sign = (floatBitsToUint(x) >> 16u) & 0x8000u;
  return sign | packSmallFloat(abs(x), 10u, rounding);
}

PL_INLINE float unpackHalfFloat(uint bits) {
  float magnitude = unpackSmallFloat(bits & 0x7fffu, 10u);
  return (bits & 0x8000u) != 0u ? -magnitude : magnitude;
}

// The low 16 bits of two values; `rounding` serves x, its hash y (nearest stays nearest).
PL_INLINE uint packHalfPair(float x, float y, uint rounding) {
  uint rounding_y = rounding == kRoundToNearest ? rounding : ditherHash(rounding);
  return packHalfFloat(x, rounding) | (packHalfFloat(y, rounding_y) << 16u);
}

PL_INLINE uint packR11G11B10(PL_FLOAT3 c, uint rounding) {
  uint rounding_y = rounding == kRoundToNearest ? rounding : ditherHash(rounding);
  uint rounding_z = rounding == kRoundToNearest ? rounding : ditherHash(rounding_y);
  return packSmallFloat(max(c.x, 0.0f), 6u, rounding) |
         (packSmallFloat(max(c.y, 0.0f), 6u, rounding_y) << 11u) |
         (packSmallFloat(max(c.z, 0.0f), 5u, rounding_z) << 22u);
}

PL_INLINE PL_FLOAT3 unpackR11G11B10(uint bits) {
  return PL_FLOAT3(unpackSmallFloat(bits & 0x7ffu, 6u),
                       unpackSmallFloat((bits >> 11u) & 0x7ffu, 6u),
                       unpackSmallFloat(bits >> 22u, 5u));
}

PL_INLINE uint packUnorm10(float x, uint rounding) {
  float carry = rounding == kRoundToNearest ? 0.5f : float(rounding >> 8u) * (1.0f / 16777216.0f);
  return min(uint(floor(clamp(x, 0.0f, 1.0f) * 1023.0f + carry)), 1023u);
}

PL_INLINE uint packRgb10A2(PL_FLOAT3 c, uint rounding) {
  uint rounding_y = rounding == kRoundToNearest ? rounding : ditherHash(rounding);
  uint rounding_z = rounding == kRoundToNearest ? rounding : ditherHash(rounding_y);
  return packUnorm10(c.x, rounding) | (packUnorm10(c.y, rounding_y) << 10u) |
         (packUnorm10(c.z, rounding_z) << 20u);
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
