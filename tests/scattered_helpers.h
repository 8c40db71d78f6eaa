// SPDX-License-Identifier: GPL-3.0-or-later
// Layouts of scattered probes for tests, and what their query should answer, written anew.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/rng.h"
#include "ddgi/snapshot.h"
#include "random_unit.h"

namespace probelab::test {

inline Vec3f randomIn(Rng& rng, const Box3f& box) {
  const Vec3f u(rng.nextFloat(), rng.nextFloat(), rng.nextFloat());
  return box.min + u * box.extent();
}

inline std::vector<QueryPoint> randomQueries(const Box3f& box, int n, uint64_t seed) {
  Rng rng(seed, RngStream::test, 5);
  std::vector<QueryPoint> points;
  for (int i = 0; i < n; ++i) {
    const Vec3f position = randomIn(rng, box);
    const Vec3f normal = randomUnit(rng);
    points.push_back({position, normal, randomUnit(rng)});
  }
  return points;
}

// The points of a lattice as corners, each with its probe alone and the lattice's lengths.
inline ProbeLayout latticeAsScattered(const ProbeLayout& lattice) {
  CornerWeights weights;
  for (const int probe : lattice.probe_of_point)
    weights.push_back({{static_cast<uint32_t>(probe), 1.0f}});
  ProbeLayout layout = scatteredLayout(Interpolant::knn, lattice.positions, lattice.bounds,
                                       lattice.lattice, std::move(weights));
  layout.strategy = "test";
  for (ProbeLengths& lengths : layout.lengths)
    lengths = {lattice.bias_length_m, lattice.support_radius_m};
  layout.bias_length_m = lattice.bias_length_m;
  layout.support_radius_m = lattice.support_radius_m;
  return layout;
}

// Probes at random in a box; at each corner the `k` nearest weigh (1 - d / d of the next)^2. Some
// corners are left without probes.
inline ProbeLayout randomScattered(const Box3f& box, int probes, const Vec3i& corners,
                                   const Box3f& bounds, uint64_t seed, std::size_t k = 6) {
  Rng rng(seed, RngStream::test, 6);
  std::vector<Vec3f> positions;
  for (int i = 0; i < probes; ++i) positions.push_back(randomIn(rng, box));
  const Lattice grid = makeLattice(bounds, corners);
  CornerWeights weights(static_cast<std::size_t>(grid.pointCount()));
  for (std::size_t c = 0; c < weights.size(); ++c) {
    if (c > 0 && rng.nextDouble() < 0.1) continue;
    std::vector<CornerWeight> all;
    for (std::size_t p = 0; p < positions.size(); ++p)
      all.push_back(
          {static_cast<uint32_t>(p), length(positions[p] - grid.position(static_cast<int>(c)))});
    std::sort(all.begin(), all.end(),
              [](const CornerWeight& a, const CornerWeight& b) { return a.weight < b.weight; });
    const std::size_t n = std::min(k, all.size() - 1);
    const float reach = all[n].weight;
    for (std::size_t i = 0; i < std::max<std::size_t>(n, 1); ++i) {
      const float fall = std::max(1 - all[i].weight / reach, 0.001f);
      weights[c].push_back({all[i].probe, fall * fall});
    }
  }
  ProbeLayout layout =
      scatteredLayout(Interpolant::knn, positions, bounds, grid, std::move(weights));
  layout.strategy = "test";
  return layout;
}

// Texels at random, the same for all layouts with as many probes.
inline void fillTexels(FieldSnapshot& snapshot, uint64_t seed) {
  Rng rng(seed, RngStream::test, 7);
  const auto stored = [&](int interior) {
    const int side = interior + 2 * snapshot.lattice.border;
    return snapshot.positions.size() * static_cast<std::size_t>(side * side);
  };
  for (std::size_t i = 0; i < stored(snapshot.lattice.irradiance_texels); ++i)
    snapshot.irradiance.emplace_back(0.2f + 0.8f * rng.nextFloat(), 0.2f + 0.8f * rng.nextFloat(),
                                     0.2f + 0.8f * rng.nextFloat());
  for (std::size_t i = 0; i < stored(snapshot.lattice.moment_texels); ++i) {
    const float mean = 0.05f + 0.6f * rng.nextFloat();
    snapshot.moments.emplace_back(mean, mean * mean * (1 + 0.2f * rng.nextFloat()));
  }
}

// Share of each probe in the interpolation at a place, from the layout's bytes and by a search for
// the cell: not normalised.
inline std::vector<double> sharesByHand(const ProbeLayout& layout, const Vec3d& place) {
  const InfluenceGrid& grid = layout.influence;
  const Vec3i n = grid.corners.count;
  int cell[3];
  double alpha[3];
  for (std::size_t a = 0; a < 3; ++a) {
    const double x = std::clamp((place[a] - static_cast<double>(grid.corners.first[a])) /
                                    static_cast<double>(grid.corners.spacing[a]),
                                0.0, n[a] - 1.0);
    cell[a] = std::min(static_cast<int>(x), n[a] - 2);
    alpha[a] = x - cell[a];
  }
  const auto voxel =
      static_cast<std::size_t>((cell[2] * (n.y - 1) + cell[1]) * (n.x - 1) + cell[0]);
  std::vector<double> shares(layout.positions.size(), 0.0);
  for (uint32_t e = grid.voxel_begin[voxel]; e < grid.voxel_begin[voxel + 1]; ++e)
    for (int k = 0; k < 8; ++k) {
      double w = std::pow(grid.entries[e].weights[static_cast<std::size_t>(k)] / 128.0, 2);
      for (std::size_t a = 0; a < 3; ++a) w *= (k >> a & 1) != 0 ? alpha[a] : 1 - alpha[a];
      shares[grid.entries[e].probe] += w;
    }
  return shares;
}

// The query of the preset rtxgi: wrap from the query point, the crushed product with Chebyshev,
// averages of roots; every length is the probe's own.
inline Vec3d rtxgiByHand(const ProbeLayout& layout, const FieldSnapshot& snapshot,
                         const Params& params, const QueryPoint& q) {
  const Vec3d x(q.position), n(q.normal);
  const Vec3d bias = n * params.normal_bias - Vec3d(q.view) * params.view_bias;
  const std::vector<double> shares =
      sharesByHand(layout, x + bias * static_cast<double>(layout.bias_length_m));
  Vec3d sum;
  double weights = 0;
  for (std::size_t p = 0; p < shares.size(); ++p) {
    if (shares[p] == 0) continue;
    const Vec3d at(snapshot.positions[p]);
    const Vec3d biased = x + bias * static_cast<double>(layout.lengths[p].bias);
    double weight = (dot(n, normalize(at - x)) + 1) / 2;
    weight = weight * weight + params.facing_offset;
    const int probe = static_cast<int>(p), border = snapshot.lattice.border;
    const Vec2d m =
        readMoments(snapshot, probe, octTaps(biased - at, snapshot.lattice.moment_texels, border));
    const double excess = length(biased - at) / static_cast<double>(layout.support_radius_m) - m.x;
    if (excess > 0) {
      const double variance =
          std::max(std::abs(m.x * m.x - m.y), snapshot.params.variance_floor * m.x * m.x);
      weight *=
          std::max(params.visibility_floor, std::pow(variance / (variance + excess * excess), 3));
    }
    weight = std::max(1e-6, weight);
    if (weight < params.crush_threshold)
      weight *= weight * weight / (params.crush_threshold * params.crush_threshold);
    weight *= shares[p];
    const Vec3d e =
        readIrradiance(snapshot, probe, octTaps(n, snapshot.lattice.irradiance_texels, border));
    sum += pow(e, Vec3d(params.encoding_gamma / 2)) * weight;
    weights += weight;
  }
  const Vec3d root = sum / weights;
  return root * root * std::numbers::pi;
}

}  // namespace probelab::test
