// SPDX-License-Identifier: Apache-2.0
#include "base/suggest.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>
#include <vector>

namespace probelab {
namespace {

constexpr std::size_t kShown = 24;  // a longer list tells nobody anything
// A longer one is no mistyped name, and comparing it takes the product of the lengths.
constexpr std::size_t kLongestName = 64;

// Letters to change, add or remove; `limit` where they are as many or more.
std::size_t editDistance(std::string_view a, std::string_view b, std::size_t limit) {
  if (std::max(a.size(), b.size()) - std::min(a.size(), b.size()) >= limit) return limit;
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0], least = i;
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitute = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min(std::min(row[j], row[j - 1]) + 1, substitute);
      least = std::min(least, row[j]);
    }
    if (least >= limit) return limit;
  }
  return row[b.size()];
}

}  // namespace

std::string nearestName(std::string_view name, std::span<const std::string> candidates) {
  std::string best;
  if (name.size() > kLongestName) return best;
  std::size_t best_distance = name.size() / 2 + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = editDistance(name, candidate, best_distance);
    if (distance < best_distance) best_distance = distance, best = candidate;
  }
  return best;
}

std::string suggestion(std::string_view name, std::span<const std::string> candidates) {
  const std::string nearest = nearestName(name, candidates);
  if (!nearest.empty()) return fmt::format(", did you mean '{}'?", nearest);
  if (candidates.empty()) return ", there are none";
  const std::span<const std::string> shown = candidates.first(std::min(candidates.size(), kShown));
  return fmt::format("; known are: {}{}", fmt::join(shown, ", "),
                     shown.size() < candidates.size() ? ", ..." : "");
}

}  // namespace probelab
