// SPDX-License-Identifier: GPL-3.0-or-later
// `jittered`: one probe at a random usable place of every cell of a partition of the free space.
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/interrupt.h"
#include "base/parallel.h"
#include "placement/grid.h"
#include "placement/random_layouts.h"
#include "placement/scattered.h"

namespace probelab {
namespace {

constexpr int kTriesACell = 16;
constexpr int kMostCellsAProbe = 1024;
constexpr int kMostCells = 1 << 22;

// A place in every cell that has a usable one, by cell.
std::vector<Vec3f> jitter(const FreeSpace& space, const Vec3i& cells, double jitter_share) {
  const Box3f box = outerBox(space.input(), {true});
  const Vec3f edge = box.extent() / Vec3f(cells);
  std::vector<std::optional<Vec3f>> place(static_cast<std::size_t>(cells.x) * cells.y * cells.z);
  const auto half = edge * static_cast<float>(0.5 * jitter_share);
  parallelFor(place.size(), 64, [&](std::size_t begin, std::size_t end) {
    throwIfInterrupted();
    for (std::size_t i = begin; i < end; ++i) {
      const auto c = static_cast<int>(i);
      const Vec3f at(Vec3i(c % cells.x, c / cells.x % cells.y, c / (cells.x * cells.y)));
      const Vec3f middle = box.min + (at + Vec3f(0.5f)) * edge;
      Rng rng(space.input().seed, RngStream::placement, 1, i);
      place[i] = space.sampleIn({middle - half, middle + half}, rng, kTriesACell);
    }
  });
  std::vector<Vec3f> result;
  for (const auto& p : place)
    if (p) result.push_back(*p);
  return result;
}

ProbeLayout placeJittered(const PlacementInput& input) {
  const double share = numberOption(input, "jitter", 0.01, 1);
  const FreeSpace space(input);
  const auto most = static_cast<std::size_t>(input.probes);
  const Vec3f edges = outerBox(input, {true}).extent();
  std::vector<Vec3f> best;
  const auto tryCells = [&](long long cells) {
    std::vector<Vec3f> found = jitter(space, cubicCounts(edges, static_cast<int>(cells), 1), share);
    const bool fits = found.size() <= most;
    if (fits && found.size() > best.size()) best = std::move(found);
    return fits;
  };
  const long long limit = std::max<long long>(
      input.probes, std::min<long long>(kMostCells, 1LL * input.probes * kMostCellsAProbe));
  long long few = input.probes, many = few;
  while (tryCells(many) && many < limit) few = many, many = std::min(2 * many, limit);
  while (many - few > std::max(1LL, few / 100)) {
    const long long middle = few + (many - few) / 2;
    (tryCells(middle) ? few : many) = middle;
  }
  if (best.empty()) {
    Rng rng(input.seed, RngStream::placement, 1, ~0ull);
    best.push_back(space.sample(rng));
  }
  return scatterProbes(space, std::move(best));
}

}  // namespace

const Strategy kJitteredStrategy = {
    "jittered", "one probe at a random place of every cell of a lattice, free space only",
    scatteredOptions({{"jitter", "1", "0.01 .. 1", "share of the cell's edges it may fall in"}}),
    placeJittered};

}  // namespace probelab
