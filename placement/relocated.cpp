// SPDX-License-Identifier: GPL-3.0-or-later
// `relocated`: a lattice whose probes move out of geometry and away from near walls, as [RTXGI]
// does with rays while it runs; here by distances, before. Weights stay the lattice's.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "placement/distance.h"
#include "placement/free_space.h"
#include "placement/grid.h"
#include "placement/lattices.h"
#include "shared/light.h"
#include "trace/sampling.h"

namespace probelab {
namespace {

constexpr float kReach = 0.45f;  // of s_i: how far a probe may move ([RTXGI])
constexpr int kSteps = 12, kExits = 64;
// Clear of the surface that a probe came out of, of s_i.
constexpr float kLeast = 0.01f;
constexpr double kClearance = 0.1;  // of s_i, unless someone asks for another

struct Mover {
  const PlacementInput& input;
  const SceneDistance& distance;
  float spacing_m;    // s_i
  float clearance_m;  // asked for

  bool inReach(const Vec3f& from, const Vec3f& p) const {
    return length(p - from) <= kReach * spacing_m;
  }

  // Along one direction: beyond the surface that the ray meets, as clear of it as the reach allows.
  std::optional<Vec3f> exitAlong(const Vec3f& from, const Vec3f& direction, float surface_m) const {
    const float least = surface_m + kLeast * spacing_m;
    const float most = std::min(surface_m + clearance_m, kReach * spacing_m);
    if (!(least <= most)) return std::nullopt;
    const Vec3f start = from + direction * least;
    for (int i = 0; i < 4; ++i) {
      const float t = most + (least - most) * static_cast<float>(i) / 3;
      const Vec3f p = from + direction * t;
      if (isUsable(input, p) && isLineFree(input.embree, start, p)) return p;
    }
    return std::nullopt;
  }

  // The shortest way out of solid geometry: through the closest point, else along the rays that
  // meet a surface soonest. Only one surface is crossed, from behind.
  std::optional<Vec3f> leaveSolid(const Vec3f& from) const {
    const std::optional<ClosestPoint> closest = distance.closest(from);
    if (!closest) return std::nullopt;
    std::vector<std::pair<float, Vec3f>> ways;
    const auto nearest = static_cast<float>(closest->distance_m);
    const Vec3f to_surface = Vec3f(closest->point - Vec3d(from));
    if (length(to_surface) > 0)
      ways.emplace_back(nearest, normalize(to_surface));
    else
      ways.emplace_back(0.0f, closest->normal);
    for (int i = 0; i < kExits; ++i) {
      const float turn = 0.61803398875f * static_cast<float>(i);
      const Vec3f direction =
          sampleSphere({(static_cast<float>(i) + 0.5f) / kExits, turn - std::floor(turn)});
      const Hit hit = input.embree.closest(Ray{from, 0, direction, kReach * spacing_m});
      if (hit.primitive != kNoHit) ways.emplace_back(hit.t, direction);
    }
    std::stable_sort(ways.begin(), ways.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    for (const auto& [surface_m, direction] : ways)
      if (const auto p = exitAlong(from, direction, surface_m)) return p;
    return std::nullopt;
  }

  // Off the surface that it lies on, to the side that is free.
  std::optional<Vec3f> leaveSurface(const Vec3f& from) const {
    const std::optional<ClosestPoint> closest = distance.closest(from);
    if (!closest) return std::nullopt;
    for (const float side : {1.0f, -1.0f})
      if (const auto p = exitAlong(from, closest->normal * side, 0)) return p;
    return std::nullopt;
  }

  // A step from p of clearance `clear` that gains some, or at least loses none and leaves another
  // surface as the closest one, not opposite (in a corner clearance grows only when the last wall
  // is left behind).
  bool isStep(double clear, const Vec3f& away, const Vec3f& next, double gain) const {
    const std::optional<ClosestPoint> there = distance.closest(next);
    if (there->distance_m >= clear + 0.25 * gain) return true;
    if (there->distance_m < 0.999 * clear) return false;
    return dot(Vec3d(away), Vec3d(next) - there->point) > -0.5 * there->distance_m;
  }

  // From `start` away from the closest surface while that helps; the way there is free, step by
  // step and straight. `from` is the lattice point.
  Vec3f gainClearance(const Vec3f& from, const Vec3f& start) const {
    Vec3f p = start;
    for (int step = 0; step < kSteps; ++step) {
      const std::optional<ClosestPoint> closest = distance.closest(p);
      if (!closest || !(closest->distance_m > 0) || closest->distance_m >= clearance_m) return p;
      const Vec3f away(normalize(Vec3d(p) - closest->point));
      const double missing = clearance_m - closest->distance_m;
      bool moved = false;
      for (double gain = missing; gain > 0.01 * clearance_m && !moved; gain *= 0.5) {
        const Vec3f next = p + away * static_cast<float>(gain);
        if (!inReach(from, next) || !isStep(closest->distance_m, away, next, gain) ||
            !isUsable(input, next) || !isLineFree(input.embree, p, next) ||
            !isLineFree(input.embree, start, next))
          continue;
        p = next;
        moved = true;
      }
      if (!moved) return p;
    }
    return p;
  }

  std::optional<Vec3f> move(const Vec3f& from) const {
    const bool usable = isUsable(input, from);
    if (usable) {
      const Vec3f p = gainClearance(from, from);
      if (p != from || distance.clearance(from) > 0) return p;
    }
    const std::optional<Vec3f> out = usable ? leaveSurface(from) : leaveSolid(from);
    if (out) return gainClearance(from, *out);
    return usable ? std::optional(from) : std::nullopt;
  }
};

ProbeLayout relocate(const PlacementInput& input, const SceneDistance& distance, double clearance,
                     const ProbeLayout& base) {
  const Lattice& lattice = base.lattice;
  const Mover mover{input, distance, base.bias_length_m,
                    static_cast<float>(clearance) * base.bias_length_m};
  const auto points = static_cast<std::size_t>(lattice.pointCount());
  std::vector<std::optional<Vec3f>> moved(points);
  parallelFor(points, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      moved[i] = mover.move(lattice.position(static_cast<int>(i)));
  });
  // Those that were free stay; of those that came out of solid geometry the ones that had least to
  // move, as far as the budget goes.
  std::vector<uint8_t> keep(points);
  std::vector<std::pair<float, std::size_t>> rescued;
  int stored = 0;
  for (std::size_t i = 0; i < points; ++i) {
    if (!moved[i]) continue;
    if (base.probe_of_point[i] >= 0)
      keep[i] = 1, ++stored;
    else
      rescued.emplace_back(length(*moved[i] - lattice.position(static_cast<int>(i))), i);
  }
  std::sort(rescued.begin(), rescued.end());
  for (const auto& [way, i] : rescued)
    if (stored < input.probes) keep[i] = 1, ++stored;
  ProbeLayout layout = latticeLayout(lattice, input.scene.bounds, keep);
  for (std::size_t i = 0; i < points; ++i)
    if (keep[i]) layout.positions[static_cast<std::size_t>(layout.probe_of_point[i])] = *moved[i];
  return layout;
}

ProbeLayout placeRelocated(const PlacementInput& input) {
  const double clearance = numberOption(input, "clearance", 0, 0.45);
  const SceneDistance distance(*input.scene.geometry);
  const LayoutFinish finish = [&](const ProbeLayout& base) {
    return relocate(input, distance, clearance, base);
  };
  switch (choiceOption(input, "base", {"grid", "grid_best", "grid_sparse"})) {
    case 1:
      return bestLattice(input, finish);
    case 2:
      return bestSparseLattice(input, true, finish);
    default: {
      // With all of its points, also where none can stay as it is.
      const Lattice lattice = gridLattice(input);
      const ProbeLayout moved = finish(
          latticeLayout(lattice, input.scene.bounds, usablePoints(lattice, input)));
      return moved.positions.empty() ? usableLayout(lattice, input) : moved;
    }
  }
}

}  // namespace

ProbeLayout relocatedLattice(const PlacementInput& input, const SceneDistance& distance,
                             const ProbeLayout& base) {
  return relocate(input, distance, kClearance, base);
}

const Strategy kRelocatedStrategy = {
    "relocated",
    "a lattice whose probes move out of geometry and away from near walls",
    {{"base", "grid", "grid | grid_best | grid_sparse",
      "the lattice that is moved; the latter two take what is best once moved"},
     {"clearance", fmt::format("{}", kClearance), "0 .. 0.45",
      "distance kept to surfaces, in smallest spacings s_i"},
     {"box", "free", "free | bounds", "what the lattice fills, with base=grid"},
     {"vertical", "1", "0.25 .. 8", "vertical spacing over the horizontal one, with base=grid"},
     {"offset", "0", "-1 .. 1", "moves the lattice along every axis, in spacings, with base=grid"}},
    placeRelocated};

}  // namespace probelab
