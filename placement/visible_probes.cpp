// SPDX-License-Identifier: GPL-3.0-or-later
#include "visible_probes.h"

#include <algorithm>

#include "placement/maxent.h"

namespace probelab {
namespace {

constexpr std::size_t kMostTested = 256;
constexpr float kMargin = 1e-4f;  // of the line, left out at the probe

}  // namespace

bool seesPlace(const EmbreeScene& embree, const Vec3f& probe, const Vec3f& place) {
  const Vec3f way = place - probe;
  const float distance_m = length(way);
  if (!(distance_m > 0)) return true;
  // From the place, whose distance to a wall may be anything: what is left out there does not grow
  // with the line, or a place near a sheet would see through it.
  return !embree.occluded(Ray{place, kOnSurface * embree.extent(), way / -distance_m,
                              (1 - kMargin) * distance_m});
}

void visibleProbes(const NearestProbes& probes, const std::vector<Vec3f>& positions,
                   const FreeSpace& space, const Vec3f& place, std::size_t count, bool visibility,
                   std::vector<NearProbe>& visible) {
  const EmbreeScene& embree = space.input().embree;
  if (!visibility) return probes.nearest(place, count, visible);
  std::vector<NearProbe> near;
  visible.clear();
  std::size_t tested = 0;
  for (std::size_t wanted = 2 * count;; wanted *= 4) {
    probes.nearest(place, std::min(wanted, kMostTested), near);
    for (; tested < near.size() && visible.size() < count; ++tested)
      if (seesPlace(embree, positions[near[tested].index], place)) visible.push_back(near[tested]);
    if (visible.size() == count || near.size() < wanted || wanted >= kMostTested) break;
  }
  if (visible.empty())
    visible.assign(near.begin(),
                   near.begin() + static_cast<std::ptrdiff_t>(std::min(count, near.size())));
}

std::vector<CornerWeight> kernelWeights(const std::vector<NearProbe>& visible, std::size_t k) {
  std::vector<CornerWeight> weights;
  const bool full = visible.size() > k;
  const std::size_t count = std::min(k, visible.size());
  if (count == 0) return weights;
  const float support_m = full ? visible[k].distance_m : kOpenSupport * visible.back().distance_m;
  for (std::size_t i = 0; i < count; ++i) {
    const float rest = support_m > 0 ? 1 - visible[i].distance_m / support_m : 0;
    if (rest > 0) weights.push_back({visible[i].index, rest * rest});
  }
  // More than k probes at one and the same distance: nothing tells them apart.
  if (weights.empty())
    for (std::size_t i = 0; i < count; ++i) weights.push_back({visible[i].index, 1});
  return weights;
}

std::vector<CornerWeight> maxentWeights(const std::vector<NearProbe>& visible, std::size_t k,
                                        const std::vector<Vec3f>& positions, const Vec3f& place,
                                        double sharpness, double cutoff) {
  std::vector<CornerWeight> weights;
  const std::size_t count = std::min(k, visible.size());
  if (count == 0) return weights;
  const float support_m =
      visible.size() > k ? visible[k].distance_m : kOpenSupport * visible.back().distance_m;
  if (!(support_m > 0)) return kernelWeights(visible, k);
  std::vector<Vec3f> offsets;
  std::vector<float> priors, shares(count);
  for (std::size_t i = 0; i < count; ++i) {
    offsets.push_back((positions[visible[i].index] - place) / support_m);
    priors.push_back(maxentPrior(visible[i].distance_m / support_m, static_cast<float>(sharpness)));
  }
  if (!(*std::ranges::max_element(priors) > 0)) return kernelWeights(visible, k);
  maxentShares(offsets, priors, shares);
  const float least =
      std::min(static_cast<float>(cutoff), 0.999f * *std::ranges::max_element(shares));
  for (std::size_t i = 0; i < count; ++i)
    if (!(shares[i] > least)) priors[i] = 0;
  maxentShares(offsets, priors, shares);
  for (std::size_t i = 0; i < count; ++i)
    if (priors[i] > 0 && shares[i] > 0) weights.push_back({visible[i].index, shares[i]});
  return weights;
}

}  // namespace probelab
