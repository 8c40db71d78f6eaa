// SPDX-License-Identifier: Apache-2.0
// Sample points of the path tracer: Owen-scrambled (0, 2)-sequences (the first two Sobol
// dimensions), padded pair by pair, each pair and each pass scrambled anew. A value is a function
// of (seed, stream, index, pass, sample, dimension) and of nothing else; passes are independent.
//
// Hash-based nested uniform scrambling: Burley, Practical Hash-based Owen Scrambling, JCGT 9(4),
// 2020, with Vegdahl's constants.
#pragma once

#include <cstdint>

#include "base/rng.h"
#include "base/vec.h"

namespace probelab {

constexpr uint32_t reverseBits(uint32_t v) {
  v = (v << 16) | (v >> 16);
  v = ((v & 0x00ff00ffu) << 8) | ((v & 0xff00ff00u) >> 8);
  v = ((v & 0x0f0f0f0fu) << 4) | ((v & 0xf0f0f0f0u) >> 4);
  v = ((v & 0x33333333u) << 2) | ((v & 0xccccccccu) >> 2);
  return ((v & 0x55555555u) << 1) | ((v & 0xaaaaaaaau) >> 1);
}

// Owen scrambling of a bit-reversed number: bit i depends on the bits below it and on the seed.
constexpr uint32_t scrambleReversed(uint32_t v, uint32_t seed) {
  v ^= v * 0x3d20adeau;
  v += seed;
  v *= (seed >> 16) | 1u;
  v ^= v * 0x05526c56u;
  v ^= v * 0x53a22864u;
  return v;
}

// Second Sobol dimension of `index`, bit-reversed: the Pascal matrix modulo 2 applied to the index.
constexpr uint32_t sobolSecondReversed(uint32_t index) {
  uint32_t v = index;
  v ^= (v & 0xaaaaaaaau) >> 1;
  v ^= (v & 0xccccccccu) >> 2;
  v ^= (v & 0xf0f0f0f0u) >> 4;
  v ^= (v & 0xff00ff00u) >> 8;
  return v ^ (v >> 16);
}

// The points of one path. Dimensions come in pairs; the first kStratifiedPairs are stratified over
// the samples of a pass, later ones are independent (padding gains nothing there).
class PathSampler {
 public:
  static constexpr uint32_t kStratifiedPairs = 16;

  PathSampler(uint64_t seed, RngStream stream, uint64_t index, uint32_t pass, uint32_t sample)
      : key_(hashCounters(seed, stream, index, pass)), sample_(sample) {}

  // Uniform in [0, 1)^2.
  Vec2f pair(uint32_t dimension) const {
    const uint64_t h = mixBits(key_ + 0x9e3779b97f4a7c15ull * (dimension + 1));
    if (dimension >= kStratifiedPairs) {
      const uint64_t bits = mixBits(h + 0xd1342543de82ef95ull * (sample_ + 1));
      return {unit(static_cast<uint32_t>(bits)), unit(static_cast<uint32_t>(bits >> 32))};
    }
    const uint64_t h2 = mixBits(h ^ 0xaf251af3b0f025b5ull);
    // Shuffling the index by an Owen scramble keeps every aligned block of 2^k samples stratified.
    const uint32_t index =
        reverseBits(scrambleReversed(reverseBits(sample_), static_cast<uint32_t>(h)));
    const uint32_t x = scrambleReversed(index, static_cast<uint32_t>(h2));
    const uint32_t y =
        scrambleReversed(sobolSecondReversed(index), static_cast<uint32_t>(h2 >> 32));
    return {unit(reverseBits(x)), unit(reverseBits(y))};
  }

 private:
  static constexpr float unit(uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

  uint64_t key_;
  uint32_t sample_;
};

}  // namespace probelab
