// SPDX-License-Identifier: GPL-3.0-or-later
// `poisson` and `poisson_best`: dart throwing in free space with a radius that shrinks until N
// probes are placed (McCool and Fiume, Hierarchical Poisson Disk Sampling Distributions, 1992).
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <unordered_map>
#include <vector>

#include "base/interrupt.h"
#include "placement/random_layouts.h"
#include "placement/scattered.h"
#include "placement/training.h"
#ifdef PROBELAB_WITH_CGAL
#include "placement/distance.h"
#endif

namespace probelab {
namespace {

// Of the spacing, where random packing is full (0.38 of the volume in balls of half that radius);
// and what remains of it after each round.
constexpr double kFirstRadius = 0.9, kShrink = 0.96;
constexpr std::size_t kDartsAProbe = 8;  // a round

// Accepted points in cells of a fixed edge.
class Disks {
 public:
  Disks(float edge_m) : edge_m_(edge_m) {}
  void add(const Vec3f& p) { cells_[key(cellOf(p))].push_back(p); }
  // radius at most the edge
  bool anyWithin(const Vec3f& p, float radius_m) const {
    const Vec3i c = cellOf(p);
    for (int z = c.z - 1; z <= c.z + 1; ++z)
      for (int y = c.y - 1; y <= c.y + 1; ++y)
        for (int x = c.x - 1; x <= c.x + 1; ++x) {
          const auto found = cells_.find(key({x, y, z}));
          if (found == cells_.end()) continue;
          for (const Vec3f& q : found->second)
            if (length(p - q) < radius_m) return true;
        }
    return false;
  }

 private:
  Vec3i cellOf(const Vec3f& p) const {
    return {static_cast<int>(std::floor(p.x / edge_m_)),
            static_cast<int>(std::floor(p.y / edge_m_)),
            static_cast<int>(std::floor(p.z / edge_m_))};
  }
  static uint64_t key(const Vec3i& c) {
    return hashCounters(0, RngStream::placement, static_cast<uint32_t>(c.x),
                        static_cast<uint32_t>(c.y), static_cast<uint32_t>(c.z));
  }
  float edge_m_;
  std::unordered_map<uint64_t, std::vector<Vec3f>> cells_;
};

// Metres to the nearest surface; infinity where nothing asks.
class Clearance {
 public:
  Clearance(const PlacementInput& input, bool wanted) {
#ifdef PROBELAB_WITH_CGAL
    if (wanted) distance_.emplace(*input.scene.geometry);
#else
    (void)input, (void)wanted;
#endif
  }
  double at([[maybe_unused]] const Vec3f& p) const {
#ifdef PROBELAB_WITH_CGAL
    if (distance_) return distance_->clearance(p);
#endif
    return std::numeric_limits<double>::infinity();
  }

 private:
#ifdef PROBELAB_WITH_CGAL
  std::optional<SceneDistance> distance_;
#endif
};

std::vector<Vec3f> throwDarts(const FreeSpace& space, const Clearance& clearance, double wall_share,
                              uint64_t seed) {
  const auto wanted = static_cast<std::size_t>(space.input().probes);
  const double spacing = space.spacing(space.input().probes);
  Disks disks(static_cast<float>(kFirstRadius * spacing));
  std::vector<Vec3f> placed;
  Rng rng(seed, RngStream::placement, 2);
  // With the radius shrinks the distance kept to walls: every N is reached.
  for (double share = 1; placed.size() < wanted; share *= kShrink) {
    const double radius = share * kFirstRadius * spacing, wall = share * wall_share * spacing;
    for (std::size_t dart = 0; dart < kDartsAProbe * wanted && placed.size() < wanted; ++dart) {
      if (dart % 256 == 0) throwIfInterrupted();
      const Vec3f p = space.candidate(rng);
      if (disks.anyWithin(p, static_cast<float>(radius)) || clearance.at(p) < wall ||
          !space.usable(p))
        continue;
      disks.add(p);
      placed.push_back(p);
    }
    if (share < 1e-6) break;  // no two places differ any more
  }
  if (placed.empty()) placed.push_back(space.roomiest());
  return placed;
}

double wallShare([[maybe_unused]] const PlacementInput& input) {
#ifdef PROBELAB_WITH_CGAL
  return numberOption(input, "clearance", 0, 0.5);
#else
  return 0;
#endif
}

std::vector<StrategyOption> poissonOptions(std::vector<StrategyOption> own = {}) {
#ifdef PROBELAB_WITH_CGAL
  own.push_back({"clearance", "0.1", "0 .. 0.5", "distance kept to surfaces, in mean spacings"});
#endif
  return scatteredOptions(std::move(own));
}

ProbeLayout placePoisson(const PlacementInput& input) {
  const double wall_share = wallShare(input);
  const FreeSpace space(input);
  return scatterProbes(space,
                       throwDarts(space, Clearance(input, wall_share > 0), wall_share, input.seed));
}

ProbeLayout placePoissonBest(const PlacementInput& input) {
  const double wall_share = wallShare(input);
  const int tries = integerOption(input, "tries", 1, 10000);
  const FreeSpace space(input);
  const Clearance clearance(input, wall_share > 0);
  double best_score = std::numeric_limits<double>::infinity();
  ProbeLayout best;
  KnownWalls walls;
  for (int i = 0; i < tries; ++i) {
    const uint64_t seed = hashCounters(input.seed, RngStream::placement, static_cast<uint64_t>(i));
    ProbeLayout layout = scatterProbes(space, throwDarts(space, clearance, wall_share, seed), {}, &walls);
    const double score = input.training.score(layout, input.params);
    if (score < best_score) best_score = score, best = std::move(layout);
    if (input.progress) input.progress((i + 1.0) / tries);
  }
  return best;
}

}  // namespace

const Strategy kPoissonStrategy = {"poisson",
                                   "N random probes in free space, as far apart as they fit",
                                   poissonOptions(), placePoisson};

const Strategy kPoissonBestStrategy = {
    "poisson_best", "the best of many `poisson` layouts on the train receivers",
    poissonOptions({{"tries", "64", "1 .. 10000", "layouts that are scored"}}), placePoissonBest};

}  // namespace probelab
