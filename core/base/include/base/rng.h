// SPDX-License-Identifier: Apache-2.0
// Counter-based random numbers: a value is a function of (seed, stream, counters) and of nothing
// else, so results do not depend on the number of threads or on the order of the work.
#pragma once

#include <cstdint>

namespace probelab {

// One stream a use, so that two uses with equal counters stay independent.
enum class RngStream : uint64_t {
  rotation = 1,
  reference_image = 2,
  receiver_position = 3,
  receiver_truth = 4,
  split = 5,
  reachability = 6,
  bootstrap = 7,
  test = 8,
  placement = 9,
  field_image = 10,
  ray_proxy = 11,
  tuning = 12,
  budget = 13,
  stability = 14,
};

// The finaliser of splitmix64 (Steele, Lea, Flood 2014): a bijection on 64 bits.
constexpr uint64_t mixBits(uint64_t v) {
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9ull;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebull;
  return v ^ (v >> 31);
}

constexpr uint64_t hashCounters(uint64_t seed, RngStream stream, uint64_t a = 0, uint64_t b = 0,
                                uint64_t c = 0) {
  uint64_t h = mixBits(seed + 0x9e3779b97f4a7c15ull);
  h = mixBits(h ^ (static_cast<uint64_t>(stream) + 0x9e3779b97f4a7c15ull));
  h = mixBits(h + a * 0xd1342543de82ef95ull + 1);
  h = mixBits(h + b * 0xaf251af3b0f025b5ull + 2);
  return mixBits(h + c * 0x9e6c63d0876a9a47ull + 3);
}

// Uniform in [0, 1), 53 and 24 bits.
constexpr double toUnitDouble(uint64_t bits) { return static_cast<double>(bits >> 11) * 0x1p-53; }
constexpr float toUnitFloat(uint64_t bits) { return static_cast<float>(bits >> 40) * 0x1p-24f; }

// A sequence of numbers for one owner: an incremented counter under a fixed key.
__extension__ typedef unsigned __int128 Uint128;

class Rng {
 public:
  constexpr Rng(uint64_t seed, RngStream stream, uint64_t a = 0, uint64_t b = 0)
      : key_(hashCounters(seed, stream, a, b)) {}
  constexpr uint64_t nextBits() { return mixBits(key_ + 0x9e3779b97f4a7c15ull * ++counter_); }
  constexpr double nextDouble() { return toUnitDouble(nextBits()); }
  constexpr float nextFloat() { return toUnitFloat(nextBits()); }
  // Uniform in [0, n); n > 0. The bias of the multiply-shift is below n / 2^64.
  constexpr uint64_t nextBelow(uint64_t n) {
    return static_cast<uint64_t>((static_cast<Uint128>(nextBits()) * n) >> 64);
  }

 private:
  uint64_t key_;
  uint64_t counter_ = 0;
};

}  // namespace probelab
