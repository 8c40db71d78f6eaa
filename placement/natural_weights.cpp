// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <map>

#include "base/interrupt.h"
#include "base/parallel.h"
#include "placement/corner_weights.h"
#include "placement/nearest_probes.h"
#include "visible_probes.h"

namespace probelab {
namespace {

constexpr double kSamplesASpacing = 8;  // along an edge
constexpr int kMostAnEdge = 8;          // of a voxel

// Corners of the grid whose distance to p is below the radius.
template <class Visit>
void cornersWithin(const Lattice& corners, const Vec3f& p, float radius_m, const Visit& visit) {
  Vec3i low, high;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float at = (p[axis] - corners.first[axis]) / corners.spacing[axis];
    const float reach = radius_m / corners.spacing[axis];
    const auto last = static_cast<float>(corners.count[axis] - 1);
    low[axis] = static_cast<int>(std::clamp(std::ceil(at - reach), 0.0f, last + 1));
    high[axis] = static_cast<int>(std::clamp(std::floor(at + reach), -1.0f, last));
  }
  for (int z = low.z; z <= high.z; ++z)
    for (int y = low.y; y <= high.y; ++y)
      for (int x = low.x; x <= high.x; ++x) {
        const int i = (z * corners.count.y + y) * corners.count.x + x;
        const Vec3f corner = corners.position(i);
        if (length(corner - p) < radius_m) visit(static_cast<std::size_t>(i), corner);
      }
}

// The samples of the grid's voxels: edges along an axis are split alike.
struct Samples {
  const Lattice& corners;
  int an_edge;  // of a voxel
  Vec3i count() const { return (corners.count - Vec3i(1, 1, 1)) * Vec3i(an_edge); }
  Vec3f position(const Vec3i& at) const {
    const Vec3f step = corners.spacing / Vec3f(static_cast<float>(an_edge));
    return corners.first + (Vec3f(at) + Vec3f(0.5f)) * step;
  }
};

struct Claim {
  std::size_t corner;
  uint32_t probe;
  auto operator<=>(const Claim&) const = default;
};

// The samples with one z: which corners would take them from which probe.
void claimLayer(const Samples& samples, const std::vector<Vec3f>& positions,
                const NearestProbes& probes, const std::vector<uint8_t>& usable,
                const FreeSpace& space, bool visibility, int z, std::vector<Claim>& claims) {
  const EmbreeScene& embree = space.input().embree;
  const Vec3i count = samples.count();
  std::vector<NearProbe> nearest;
  for (int y = 0; y < count.y; ++y)
    for (int x = 0; x < count.x; ++x) {
      const Vec3f p = samples.position({x, y, z});
      visibleProbes(probes, positions, space, p, 1, visibility, nearest);
      const NearProbe& owner = nearest.front();
      // Nearest regardless: the sample sees no probe, so it lies in a wall or out of reach.
      if (visibility && !seesPlace(embree, positions[owner.index], p)) continue;
      cornersWithin(samples.corners, p, owner.distance_m, [&](std::size_t i, const Vec3f& corner) {
        if (usable[i] && (!visibility || seesPlace(embree, p, corner)))
          claims.push_back({i, owner.index});
      });
    }
}

}  // namespace

CornerWeights naturalWeights(const Lattice& corners, const std::vector<Vec3f>& positions,
                             const FreeSpace& space, const CornerSettings& settings) {
  const NearestProbes probes(positions);
  CornerWeights weights(static_cast<std::size_t>(corners.pointCount()));
  std::vector<uint8_t> usable(weights.size());
  parallelFor(usable.size(), 64, [&](std::size_t begin, std::size_t end) {
    throwIfInterrupted();
    for (std::size_t i = begin; i < end; ++i)
      usable[i] = space.usable(corners.position(static_cast<int>(i))) ? 1 : 0;
  });
  const double spacing_m = space.spacing(static_cast<int>(positions.size()));
  const double voxel_m = static_cast<double>(maxComponent(corners.spacing));
  const Samples samples{
      corners, std::clamp(static_cast<int>(std::lround(kSamplesASpacing * voxel_m / spacing_m)), 1,
                          kMostAnEdge)};
  std::vector<std::vector<Claim>> claims(static_cast<std::size_t>(samples.count().z));
  parallelFor(claims.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t layer = begin; layer < end; ++layer) {
      throwIfInterrupted();
      claimLayer(samples, positions, probes, usable, space, settings.visibility,
                 static_cast<int>(layer), claims[layer]);
      std::sort(claims[layer].begin(), claims[layer].end());
    }
  });
  // A corner collects from several layers; counts are exact in float up to 2^24.
  for (const auto& layer : claims)
    for (const Claim& claim : layer) {
      auto& at = weights[claim.corner];
      const auto same = std::find_if(at.begin(), at.end(),
                                     [&](const CornerWeight& w) { return w.probe == claim.probe; });
      if (same == at.end())
        at.push_back({claim.probe, 1});
      else
        same->weight += 1;
    }
  CornerSettings nearest = settings;
  nearest.k = 1;
  const CornerWeights others = nearestWeights(corners, positions, space, nearest);
  const CornerWeights walls = nearestWeights(corners, positions, space, settings);
  for (std::size_t i = 0; i < weights.size(); ++i)
    if (weights[i].empty()) weights[i] = usable[i] ? others[i] : walls[i];
  return weights;
}

}  // namespace probelab
