// SPDX-License-Identifier: Apache-2.0
#include "proxy_error.h"

#include <algorithm>
#include <cmath>

#include "base/rng.h"

namespace probelab {
namespace {

std::vector<TrianglePoints> pointsOf(const Geometry& geometry, std::span<const Corners> faces) {
  std::vector<TrianglePoints> result;
  for (const Corners& f : faces)
    result.push_back({Vec3d(geometry.positions[f[0]]), Vec3d(geometry.positions[f[1]]),
                      Vec3d(geometry.positions[f[2]])});
  return result;
}

double areaOf(const TrianglePoints& t) { return 0.5 * length(cross(t[1] - t[0], t[2] - t[0])); }

// `count` points by area, one from each equal share of it.
double worstAtRandom(const std::vector<TrianglePoints>& from, const TriangleDistance& to,
                     std::size_t count, Rng rng) {
  double area = 0, worst = 0;
  for (const TrianglePoints& t : from) area += areaOf(t);
  if (!(area > 0)) return 0;
  std::size_t done = 0;
  double passed = 0;
  for (const TrianglePoints& t : from) {
    passed += areaOf(t);
    const auto until =
        std::min(static_cast<std::size_t>(passed / area * static_cast<double>(count)), count);
    for (; done < until; ++done) {
      const double root = std::sqrt(rng.nextDouble());
      worst = std::max(worst, to(pointOf(t, {root * rng.nextDouble(), 1 - root})));
    }
  }
  return worst;
}

double worstAtMarks(const std::vector<TrianglePoints>& from, const TriangleDistance& to) {
  double worst = 0;
  for (const TrianglePoints& t : from) {
    worst = std::max(worst, to((t[0] + t[1] + t[2]) / 3.0));
    for (std::size_t k = 0; k < 3; ++k)
      worst = std::max({worst, to(t[k]), to((t[k] + t[(k + 1) % 3]) * 0.5)});
  }
  return worst;
}

}  // namespace

double totalArea(const Geometry& geometry, std::span<const Corners> faces) {
  double area = 0;
  for (const TrianglePoints& t : pointsOf(geometry, faces)) area += areaOf(t);
  return area;
}

ProxyErrorMeter::ProxyErrorMeter(const Geometry& geometry, std::span<const Corners> original)
    : geometry_(geometry), original_(pointsOf(geometry, original)), to_original_(original_) {}

ProxyError ProxyErrorMeter::measure(std::span<const Corners> proxy, uint64_t seed) const {
  const std::vector<TrianglePoints> after = pointsOf(geometry_, proxy);
  const TriangleDistance to_proxy(after);
  const std::size_t count = 2 * original_.size();
  ProxyError error;
  for (const TrianglePoints& t : original_) error.area_before_m2 += areaOf(t);
  for (const TrianglePoints& t : after) error.area_after_m2 += areaOf(t);
  error.to_proxy_m =
      std::max(worstAtMarks(original_, to_proxy),
               worstAtRandom(original_, to_proxy, count, Rng(seed, RngStream::ray_proxy, 1)));
  error.to_original_m =
      std::max(worstAtMarks(after, to_original_),
               worstAtRandom(after, to_original_, count, Rng(seed, RngStream::ray_proxy, 2)));
  return error;
}

}  // namespace probelab
