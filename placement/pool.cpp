// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/pool.h"

#include <algorithm>

#include "base/rng.h"

namespace probelab {
namespace {

constexpr uint64_t kFirstStream = 1 << 24;  // of random numbers, beyond those of receivers
constexpr float kOffWall = 0.02f;  // of the spacing, where candidates stand before a wall

// A place of free space before a wall that looks as the wall does, or anywhere with any direction.
Receiver poolPoint(const Training::Data& data, const Receiver& from, float spacing_m) {
  Receiver point = from;
  if (from.kind != ReceiverKind::surface) {
    point.view = -point.normal;
    return point;
  }
  float away = spacing_m * kOffWall;
  const Vec3f start = from.position + from.normal * (1e-4f * data.embree.extent());
  const Hit hit = data.embree.closest(Ray{start, 0, from.normal, 2 * away});
  if (hit.primitive != kNoHit) away = std::min(away, 0.5f * hit.t);
  point.position = from.position + from.normal * away;
  return point;
}

}  // namespace

void addPool(JudgedPoints& judged, const Training::Data& data, const PoolSettings& settings,
             uint64_t seed) {
  const Receivers places = generateReceivers(data.scene, data.embree, data.reachability,
                                             static_cast<uint32_t>(settings.points),
                                             hashCounters(seed, RngStream::placement, 30));
  std::vector<Receiver> points;
  double area = 0;
  for (const Receiver& place : places.points) {
    points.push_back(poolPoint(data, place, settings.spacing_m));
    area += place.area;
  }
  const std::vector<float> truth = gatherTruth(data, points, kFirstStream);
  for (Receiver& r : judged.points) r.area *= 1 - settings.share;
  for (Receiver& point : points) point.area *= settings.share / area;
  judged.points.insert(judged.points.end(), points.begin(), points.end());
  judged.truth.insert(judged.truth.end(), truth.begin(), truth.end());
}

}  // namespace probelab
