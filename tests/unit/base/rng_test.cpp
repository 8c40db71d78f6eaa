// SPDX-License-Identifier: GPL-3.0-or-later
// Random numbers: repeatable, uniform, and independent between neighbouring keys. All seeds are
// fixed, so these tests pass or fail for good; the bounds are 5 standard deviations.
#include "base/rng.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

namespace probelab {
namespace {

TEST(Rng, IsAFunctionOfItsKeyAlone) {
  Rng a(1, RngStream::test, 2, 3), b(1, RngStream::test, 2, 3);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(a.nextBits(), b.nextBits());
  static_assert(hashCounters(1, RngStream::test, 2, 3, 4) ==
                hashCounters(1, RngStream::test, 2, 3, 4));
}

TEST(Rng, MixesAsSplitmix64) {
  // The first outputs of splitmix64 from seed 1234567 (the generator's published test values).
  const uint64_t step = 0x9e3779b97f4a7c15ull;
  EXPECT_EQ(mixBits(1234567 + step), 6457827717110365317ull);
  EXPECT_EQ(mixBits(1234567 + 2 * step), 3203168211198807973ull);
}

TEST(Rng, EveryPartOfTheKeyChangesTheValue) {
  std::set<uint64_t> seen;
  size_t count = 0;
  for (uint64_t seed : {0, 1, 2})
    for (RngStream stream : {RngStream::rotation, RngStream::split, RngStream::test})
      for (uint64_t a = 0; a < 10; ++a)
        for (uint64_t b = 0; b < 10; ++b)
          for (uint64_t c = 0; c < 10; ++c, ++count)
            seen.insert(hashCounters(seed, stream, a, b, c));
  EXPECT_EQ(seen.size(), count);
}

TEST(Rng, UnitNumbersStayBelowOne) {
  EXPECT_EQ(toUnitDouble(0), 0.0);
  EXPECT_LT(toUnitDouble(~uint64_t{0}), 1.0);
  EXPECT_EQ(toUnitFloat(0), 0.0f);
  EXPECT_LT(toUnitFloat(~uint64_t{0}), 1.0f);
}

// Chi-square of counts that should be equal, as its distance from the mean in standard deviations.
double chiSquareDeviation(const std::vector<int>& counts, double expected) {
  double chi2 = 0;
  for (const int n : counts) chi2 += (n - expected) * (n - expected) / expected;
  const double freedom = double(counts.size()) - 1;
  return (chi2 - freedom) / std::sqrt(2 * freedom);
}

TEST(Rng, NumbersOfASequenceAreUniform) {
  Rng rng(7, RngStream::test);
  std::vector<int> doubles(100), floats(100), below(100);
  for (int i = 0; i < 100000; ++i) {
    ++doubles[size_t(100 * rng.nextDouble())];
    ++floats[size_t(100 * rng.nextFloat())];
    ++below[rng.nextBelow(100)];
  }
  EXPECT_LT(std::abs(chiSquareDeviation(doubles, 1000)), 5);
  EXPECT_LT(std::abs(chiSquareDeviation(floats, 1000)), 5);
  EXPECT_LT(std::abs(chiSquareDeviation(below, 1000)), 5);
}

// Pairs (u, v) on a 16 x 16 grid.
template <class Pair>
double pairDeviation(const Pair& pairOf) {
  std::vector<int> counts(256);
  for (uint64_t i = 0; i < 100000; ++i) {
    const auto [u, v] = pairOf(i);
    ++counts[size_t(16 * toUnitDouble(u)) * 16 + size_t(16 * toUnitDouble(v))];
  }
  return std::abs(chiSquareDeviation(counts, 100000 / 256.0));
}

TEST(Rng, NeighbouringKeysAreIndependent) {
  using P = std::pair<uint64_t, uint64_t>;
  const auto h = [](uint64_t seed, uint64_t a, uint64_t b, uint64_t c) {
    return hashCounters(seed, RngStream::test, a, b, c);
  };
  EXPECT_LT(pairDeviation([&](uint64_t i) { return P(h(1, i, 0, 0), h(1, i + 1, 0, 0)); }), 5);
  EXPECT_LT(pairDeviation([&](uint64_t i) { return P(h(1, i, 0, 0), h(1, i, 1, 0)); }), 5);
  EXPECT_LT(pairDeviation([&](uint64_t i) { return P(h(1, i, 0, 0), h(1, i, 0, 1)); }), 5);
  EXPECT_LT(pairDeviation([&](uint64_t i) { return P(h(i, 0, 0, 0), h(i + 1, 0, 0, 0)); }), 5);
  EXPECT_LT(pairDeviation([&](uint64_t i) { return P(h(1, 0, i, 0), h(1, i, 0, 0)); }), 5);
  EXPECT_LT(pairDeviation([&](uint64_t i) {
              return P(hashCounters(1, RngStream::rotation, i),
                       hashCounters(1, RngStream::split, i));
            }),
            5);
}

TEST(Rng, ConsecutiveNumbersOfASequenceAreIndependent) {
  Rng rng(3, RngStream::test);
  EXPECT_LT(pairDeviation([&](uint64_t) {
              const uint64_t u = rng.nextBits();
              return std::pair(u, rng.nextBits());
            }),
            5);
}

}  // namespace
}  // namespace probelab
