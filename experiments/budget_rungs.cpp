// SPDX-License-Identifier: GPL-3.0-or-later
#include "budget_rungs.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/parallel.h"
#include "budget_pairs.h"
#include "budget_rays.h"
#include "ddgi/directions.h"
#include "ddgi/snapshot.h"
#include "ddgi/texel_fit.h"
#include "ddgi/texels.h"
#include "tuning/exact_visibility.h"

namespace probelab {
namespace {

// Moments that make the query's Chebyshev bound 1 or 0 at any distance above 0.
const Vec2d kSeen(1e30, 1e60);
const Vec2d kHidden(0, 0);

// Directions of the exact rungs are those of rotations that no field reaches.
constexpr uint64_t kExactRotation = uint64_t{1} << 40;
constexpr uint64_t kPairLobes = 0, kTexelLobes = 1, kAheadLobes = 2;  // counters of their turns
constexpr std::size_t kProbesAtOnce = 32;            // between two reports of progress

// Parameters that store what they are given.
Params withoutFormats(const Params& params) {
  Params fine = params;
  fine.irradiance_format = PL_FORMAT_RGBA32F;
  fine.moment_format = PL_FORMAT_RG32F;
  fine.moment_encoding = PL_MOMENTS_RAW;
  fine.encoding_gamma = 1;
  return fine;
}

// Maps of the probes that are read, interior texels, linear; [used probe][texel].
struct ProbeMaps {
  std::size_t irradiance_size = 0, moment_size = 0;  // texels of a map
  std::vector<Vec3f> first, second;
  std::vector<Vec2f> moments;

  std::span<Vec3f> irradiance(int half, std::size_t probe) {
    return std::span(half == 0 ? first : second).subspan(probe * irradiance_size, irradiance_size);
  }
  std::span<Vec2f> momentsOf(std::size_t probe) {
    return std::span(moments).subspan(probe * moment_size, moment_size);
  }
  uint64_t bytes() const {
    return (first.size() + second.size()) * sizeof(Vec3f) + moments.size() * sizeof(Vec2f);
  }
};

// Interior texels of a map -> the tile that holds them, with the border where there is one.
template <class T>
void fillTile(std::span<const T> interior, int texels, int border, T* tile) {
  const int side = texels + 2 * border;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      tile[y * side + x] =
          interior[static_cast<std::size_t>(tileTexel(x - border, y - border, texels, 0))];
}

class Budget {
 public:
  Budget(const BudgetField& field, const BudgetRays& rays, std::span<const QueryPoint> points,
         const std::function<void(double)>& progress)
      : field_(field),
        rays_(rays),
        points_(points),
        progress_(progress),
        fine_(withoutFormats(field.params)),
        sides_(atlasSides(field.params)),
        snapshot_(layoutSnapshot(field.layout, field.states, fine_)),
        pairs_(pairPoints(snapshot_, points)),
        tracer_(field.scene, field.embree, field.seed) {
    if (field.params.irradiance_fit != 0) fit_ = bilinearFit(sides_.irradiance);
    const double exact = rays.exact, lobes = static_cast<double>(sides_.moments) * sides_.moments;
    total_ = static_cast<double>(pairs_.used.size()) *
             (exact * kPathCost + (hasMoments() ? lobes * rays.lobe : 0) +
              field.average_updates * 2.0 * field.params.rays * kPathCost +
              field.mixing_updates * field.params.rays);
  }

  BudgetEstimates run() {
    result_.probes_read = pairs_.used.size();
    ProbeMaps maps = traceExactly();
    readPairs();
    result_.texels = readMaps(maps, fine_);
    maps = traceUpdates();
    result_.rays = readMaps(maps, fine_);
    result_.formats = readMaps(maps, field_.params);
    result_.work = {closest_, shadow_};
    return std::move(result_);
  }

 private:
  static constexpr double kPathCost = 8;  // of a path, in rays; for progress alone

  bool hasMoments() const { return field_.params.visibility != 0; }
  const Vec3f& position(int probe) const { return snapshot_.fetchPosition(probe); }

  DistanceUnits distanceRule(int probe) const {
    const auto unit = static_cast<double>(field_.layout.support_radius_m);
    const auto support =
        static_cast<double>(probeLengths(field_.layout, static_cast<std::size_t>(probe)).support);
    return {unit, field_.params.distance_clamp * support / unit, field_.params.backface_shortening};
  }

  ProbeMaps emptyMaps() const {
    ProbeMaps maps;
    const auto squared = [](int side) { return static_cast<std::size_t>(side) * side; };
    maps.irradiance_size = squared(sides_.irradiance);
    maps.first.resize(pairs_.used.size() * maps.irradiance_size);
    maps.second = maps.first;
    if (!hasMoments()) return maps;
    maps.moment_size = squared(sides_.moments);
    maps.moments.resize(pairs_.used.size() * maps.moment_size);
    return maps;
  }

  WeightTable weights(std::span<const Vec3f> directions, bool irradiance) const {
    Lobe lobe;
    lobe.texels = irradiance ? sides_.irradiance : sides_.moments;
    if (!irradiance) lobe.exponent = field_.params.distance_exponent;
    if (irradiance && fit_.size() > 0) lobe.fit = &fit_;
    return makeWeightTable(directions, lobe, 1);
  }

  // body(place in pairs_.used, rays), in parallel with a count of rays; `cost` of a probe.
  template <class Body>
  void forProbes(double cost, std::size_t at_once, const Body& body) {
    for (std::size_t first = 0; first < pairs_.used.size(); first += at_once) {
      const std::size_t count = std::min(at_once, pairs_.used.size() - first);
      parallelFor(count, 1, [&](std::size_t begin, std::size_t end) {
        throwIfInterrupted();
        const FlushDenormals flush;
        RayCount rays;
        for (std::size_t i = begin; i < end; ++i) body(first + i, rays);
        closest_ += rays.closest, shadow_ += rays.shadow;
      });
      done_ += cost * static_cast<double>(count);
      if (progress_) progress_(std::min(1.0, done_ / total_));
    }
  }

  // Directions in which pairs read irradiance.
  void findDirections() {
    pair_directions_.resize(pairs_.probe.size());
    forProbes(0, kProbesAtOnce, [&](std::size_t i, RayCount& rays) {
      const int probe = pairs_.used[i];
      const DistanceUnits rule = distanceRule(probe);
      for (const uint32_t pair : pairsOf(probe)) {
        const QueryPoint& point = points_[pairs_.point[pair]];
        double ahead_m = 0;
        if (snapshot_.modes.parallax != 0)
          ahead_m = lobeAlong(probe, Vec3d(point.normal), kAheadLobes, pairs_.point[pair], rule,
                              rays).x * rule.unit_m;
        pair_directions_[pair] = readingDirection(snapshot_, point, probe, ahead_m);
      }
    });
  }

  Vec2d lobeAlong(int probe, const Vec3d& axis, uint64_t kind, uint64_t index,
                  const DistanceUnits& rule, RayCount& rays) {
    const double turn = toUnitDouble(
        hashCounters(field_.seed, RngStream::budget, kind, static_cast<uint64_t>(probe), index));
    return tracer_.lobeMoments(position(probe), Vec3f(axis), field_.params.distance_exponent,
                               rays_.lobe, turn, rule, rays);
  }

  // Irradiance in the pairs' directions, pairs' visibility and moments; maps of very many rays.
  ProbeMaps traceExactly() {
    findDirections();
    ProbeMaps maps = emptyMaps();
    for (auto& half : pair_irradiance_) half.resize(pairs_.probe.size());
    seen_.resize(pairs_.probe.size());
    pair_moments_.resize(hasMoments() ? pairs_.probe.size() : 0);
    const auto count = static_cast<std::size_t>(rays_.exact / 2);
    for (int half = 0; half < 2; ++half) {
      const std::vector<Vec3f> directions = updateDirections(
          rays_.exact / 2, field_.seed, kExactRotation + static_cast<uint64_t>(half));
      const WeightTable table = weights(directions, true);
      forProbes(rays_.exact / 2 * kPathCost, kProbesAtOnce, [&](std::size_t i, RayCount& rays) {
        const int probe = pairs_.used[i];
        std::vector<ProbeRay> traced(count);
        tracer_.trace(position(probe), directions, 1, static_cast<uint64_t>(probe),
                      static_cast<uint32_t>(half), traced, rays);
        blendRadiance(table, traced, 0, field_.params, 1, maps.irradiance(half, i));
        readRays(probe, half, traced, directions);
      });
    }
    forProbes(hasMoments() ? static_cast<double>(maps.moment_size) * rays_.lobe : 0, kProbesAtOnce,
              [&](std::size_t i, RayCount& rays) { traceVisibility(i, maps, rays); });
    noteBytes(maps.bytes());
    return maps;
  }

  // What the points that read a probe find in the hemispheres of their directions.
  void readRays(int probe, int half, std::span<const ProbeRay> rays,
                std::span<const Vec3f> directions) {
    if (isFrozen(rays, field_.params)) return;
    for (const uint32_t pair : pairsOf(probe))
      pair_irradiance_[static_cast<std::size_t>(half)][pair] = radianceUnderCosine(
          rays, directions, 0, pair_directions_[pair], field_.params);
  }

  std::span<const uint32_t> pairsOf(int probe) const {
    const auto p = static_cast<std::size_t>(probe);
    return std::span(pairs_.of_probe)
        .subspan(pairs_.probe_begin[p], pairs_.probe_begin[p + 1] - pairs_.probe_begin[p]);
  }

  void traceVisibility(std::size_t place, ProbeMaps& maps, RayCount& rays) {
    const int probe = pairs_.used[place];
    const DistanceUnits rule = distanceRule(probe);
    const auto momentsAlong = [&](const Vec3d& axis, uint64_t kind, uint64_t index) {
      return lobeAlong(probe, axis, kind, index, rule, rays);
    };
    for (const uint32_t pair : pairsOf(probe)) {
      const QueryPoint& point = points_[pairs_.point[pair]];
      ++rays.shadow;
      seen_[pair] = seesProbe(field_.embree, point, position(probe)) ? kSeen : kHidden;
      if (!hasMoments()) continue;
      const Vec3d offset = readingOffset(snapshot_, point, probe);
      // The query's own choice where the direction is none.
      const Vec3d axis = dot(offset, offset) > 0 ? normalize(offset) : Vec3d(0, 0, 1);
      pair_moments_[pair] = momentsAlong(axis, kPairLobes, pairs_.point[pair]);
    }
    if (!hasMoments()) return;
    const std::span<Vec2f> texels = maps.momentsOf(place);
    for (int t = 0; t < sides_.moments * sides_.moments; ++t) {
      const double n = sides_.moments;
      const Vec3d axis = texelDirection<double>(t % sides_.moments, t / sides_.moments, n);
      texels[static_cast<std::size_t>(t)] =
          Vec2f(momentsAlong(axis, kTexelLobes, static_cast<uint64_t>(t)));
    }
  }

  // The two rungs without texels.
  void readPairs() {
    QueryModes traced = snapshot_.modes;
    traced.visibility = 1;
    QueryParams<double> sharp = snapshot_.params;
    sharp.chebyshev_power = 1;
    sharp.visibility_floor = sharp.variance_bias = sharp.variance_floor = 0;
    const std::vector<Vec2d>& moments = hasMoments() ? pair_moments_ : seen_;
    const auto read = [&](const QueryParams<double>& params, const QueryModes& modes,
                          std::size_t half, const std::vector<Vec2d>& visibility) {
      std::vector<Vec3f> answers(points_.size());
      forPoints([&](std::size_t i) {
        answers[i] = queryPairs(snapshot_, params, modes, pairs_, points_, i,
                                pair_irradiance_[half], visibility);
      });
      return answers;
    };
    result_.exact = {read(sharp, traced, 0, seen_), read(sharp, traced, 1, seen_)};
    result_.moments = {read(snapshot_.params, snapshot_.modes, 0, moments),
                       read(snapshot_.params, snapshot_.modes, 1, moments)};
    for (auto& half : pair_irradiance_) std::vector<Vec3f>().swap(half);
    std::vector<Vec2d>().swap(seen_), std::vector<Vec2d>().swap(pair_moments_);
  }

  // Maps from the field's own directions, averaged as convergeField does.
  ProbeMaps traceUpdates() {
    ProbeMaps maps = emptyMaps();
    const int rays_count = field_.params.rays;
    for (int u = 0; u < field_.mixing_updates + field_.average_updates; ++u) {
      const int lit = u - field_.mixing_updates + 1;  // that many updates of light
      const int paths = lit > 0 ? 2 : 0;
      if (paths == 0 && !hasMoments()) continue;
      const auto rotation = static_cast<uint64_t>(u + 1);
      const std::vector<Vec3f> directions = updateDirections(rays_count, field_.seed, rotation);
      const WeightTable irradiance = weights(directions, true);
      const WeightTable moments = hasMoments() ? weights(directions, false) : WeightTable();
      const double cost = rays_count * (paths > 0 ? paths * kPathCost : 1);
      forProbes(cost, pairs_.used.size(), [&](std::size_t i, RayCount& count) {
        const int probe = pairs_.used[i];
        std::vector<ProbeRay> rays(directions.size());
        tracer_.trace(position(probe), directions, paths, static_cast<uint64_t>(probe),
                      2 * static_cast<uint32_t>(rotation), rays, count);
        for (int half = 0; half < paths; ++half)
          blendRadiance(irradiance, rays, half, field_.params, lit, maps.irradiance(half, i));
        if (hasMoments())
          blendDistances(moments, rays, distanceRule(probe), u + 1, maps.momentsOf(i));
      });
    }
    noteBytes(maps.bytes());
    return maps;
  }

  // The query over maps as `params` store them.
  RungEstimate readMaps(const ProbeMaps& maps, const Params& params) {
    RungEstimate estimate;
    FieldSnapshot stored = layoutSnapshot(field_.layout, field_.states, params);
    storeMoments(maps, params, stored);
    for (int half = 0; half < 2; ++half) {
      storeIrradiance(half == 0 ? maps.first : maps.second, maps.irradiance_size, params, stored);
      std::vector<Vec3f> answers(points_.size());
      forPoints([&](std::size_t i) {
        answers[i] = Vec3f(querySnapshot(stored, stored.params, points_[i]).irradiance);
      });
      (half == 0 ? estimate.first : estimate.second) = std::move(answers);
    }
    noteBytes(maps.bytes() + stored.irradiance.size() * sizeof(Vec3f) +
              stored.moments.size() * sizeof(Vec2f));
    return estimate;
  }

  void storeIrradiance(std::span<const Vec3f> linear, std::size_t size, const Params& params,
                       FieldSnapshot& stored) const {
    const auto tile = static_cast<std::size_t>(sides_.stored(sides_.irradiance)) *
                      static_cast<std::size_t>(sides_.stored(sides_.irradiance));
    stored.irradiance.resize(field_.layout.positions.size() * tile);
    std::vector<Vec3f> map(size);
    for (std::size_t i = 0; i < pairs_.used.size(); ++i) {
      std::transform(linear.begin() + static_cast<std::ptrdiff_t>(i * size),
                     linear.begin() + static_cast<std::ptrdiff_t>((i + 1) * size), map.begin(),
                     [&](const Vec3f& mean) { return storedIrradiance(params, mean); });
      fillTile<Vec3f>(map, sides_.irradiance, sides_.border,
                      &stored.irradiance[static_cast<std::size_t>(pairs_.used[i]) * tile]);
    }
  }

  void storeMoments(const ProbeMaps& maps, const Params& params, FieldSnapshot& stored) const {
    if (!hasMoments()) return;
    const auto side = static_cast<std::size_t>(sides_.stored(sides_.moments));
    stored.moments.resize(field_.layout.positions.size() * side * side);
    std::vector<Vec2f> map(maps.moment_size);
    for (std::size_t i = 0; i < pairs_.used.size(); ++i) {
      for (std::size_t t = 0; t < map.size(); ++t)
        map[t] = storedMoments(params, maps.moments[i * maps.moment_size + t]);
      fillTile<Vec2f>(map, sides_.moments, sides_.border,
                      &stored.moments[static_cast<std::size_t>(pairs_.used[i]) * side * side]);
    }
  }

  // What is read back of a value, still encoded.
  static Vec3f storedIrradiance(const Params& params, const Vec3f& mean) {
    Vec3f encoded = mean;
    const auto exponent = static_cast<float>(1 / params.encoding_gamma);
    if (params.encoding_gamma != 1)
      encoded = {std::pow(mean.x, exponent), std::pow(mean.y, exponent),
                 std::pow(mean.z, exponent)};
    std::array<uint32_t, 4> words{};
    packIrradiance(params.irradiance_format, encoded, words.data());
    return unpackIrradiance(params.irradiance_format, words.data());
  }
  static Vec2f storedMoments(const Params& params, const Vec2f& moments) {
    Vec2f value = moments;
    if (params.moment_encoding == PL_MOMENTS_CENTRAL)
      value.y = std::sqrt(std::max(value.y - value.x * value.x, 0.0f));
    std::array<uint32_t, 2> words{floatBitsToUint(value.x), floatBitsToUint(value.y)};
    if (params.moment_format != PL_FORMAT_RG32F)
      words[0] = packHalfPair(value.x, value.y, kRoundToNearest);
    return unpackMoments(params.moment_format, params.moment_encoding, words.data());
  }

  template <class Body>
  void forPoints(const Body& body) const {
    parallelFor(points_.size(), 64, [&](std::size_t begin, std::size_t end) {
      const FlushDenormals flush;
      for (std::size_t i = begin; i < end; ++i) body(i);
    });
  }

  void noteBytes(uint64_t maps) {
    const uint64_t a_pair = 3 * sizeof(Vec3f) + 2 * sizeof(Vec2d) + 4 * sizeof(uint32_t);
    result_.bytes = std::max(result_.bytes, maps + pairs_.probe.size() * a_pair);
  }

  const BudgetField& field_;
  BudgetRays rays_;
  std::span<const QueryPoint> points_;
  const std::function<void(double)>& progress_;
  Params fine_;
  AtlasSides sides_;
  Eigen::MatrixXd fit_;
  FieldSnapshot snapshot_;  // of fine_, without texels
  ProbePairs pairs_;
  ProbeRayTracer tracer_;
  std::array<std::vector<Vec3f>, 2> pair_irradiance_;  // mean radiance, [half][pair]
  std::vector<Vec3f> pair_directions_;                  // that irradiance is read in, [pair]
  std::vector<Vec2d> seen_, pair_moments_;
  BudgetEstimates result_;
  std::atomic<uint64_t> closest_{0}, shadow_{0};
  double total_ = 0, done_ = 0;
};

}  // namespace

BudgetEstimates estimateBudget(const BudgetField& field, const BudgetRays& rays,
                               std::span<const QueryPoint> points,
                               const std::function<void(double)>& progress) {
  PROBELAB_CHECK(rays.exact >= 2 && rays.exact % 2 == 0 && rays.lobe >= 1);
  return Budget(field, rays, points, progress).run();
}

}  // namespace probelab
