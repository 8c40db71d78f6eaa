// SPDX-License-Identifier: GPL-3.0-or-later
#include "budget_pairs.h"

#include <algorithm>
#include <numeric>

#include "base/error.h"
#include "base/parallel.h"

namespace probelab {
namespace {

const Vec3f kNoIrradiance;
const Vec2f kNoMoments;

// Notes the probes that are fetched.
struct NotingView : FieldView {
  std::vector<int>& probes;

  const Vec3f& fetchIrradiance(int probe, int) const {
    if (std::find(probes.begin(), probes.end(), probe) == probes.end()) probes.push_back(probe);
    return kNoIrradiance;
  }
  const Vec2f& fetchMoments(int, int) const { return kNoMoments; }
  float fetchAhead(int, int) const { return 0; }
};

// Of one point. Irradiance is that of the pair's reading direction, so the distance ahead is not
// asked for.
struct PairView : FieldView {
  std::span<const int> probes;
  std::span<const Vec3f> irradiance;
  std::span<const Vec2d> moments;

  std::size_t find(int probe) const {
    const auto at = std::find(probes.begin(), probes.end(), probe);
    PROBELAB_CHECK(at != probes.end());
    return static_cast<std::size_t>(at - probes.begin());
  }
  const Vec3f& fetchIrradiance(int probe, int) const { return irradiance[find(probe)]; }
  const Vec2d& fetchMoments(int probe, int) const { return moments[find(probe)]; }
  float fetchAhead(int, int) const { return 0; }
};

void sortByProbe(ProbePairs& pairs, std::size_t probes) {
  pairs.probe_begin.assign(probes + 1, 0);
  for (const int probe : pairs.probe) ++pairs.probe_begin[static_cast<std::size_t>(probe) + 1];
  for (std::size_t p = 0; p < probes; ++p)
    if (pairs.probe_begin[p + 1] > 0) pairs.used.push_back(static_cast<int>(p));
  std::partial_sum(pairs.probe_begin.begin(), pairs.probe_begin.end(), pairs.probe_begin.begin());
  std::vector<uint32_t> next(pairs.probe_begin.begin(), pairs.probe_begin.end() - 1);
  pairs.of_probe.resize(pairs.probe.size());
  for (std::size_t i = 0; i < pairs.probe.size(); ++i)
    pairs.of_probe[next[static_cast<std::size_t>(pairs.probe[i])]++] = static_cast<uint32_t>(i);
}

}  // namespace

ProbePairs pairPoints(const FieldSnapshot& field, std::span<const QueryPoint> points) {
  std::vector<std::vector<int>> read(points.size());
  parallelFor(points.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      queryView(NotingView{{field}, read[i]}, field.params, field.modes, points[i]);
  });
  ProbePairs pairs;
  pairs.begin.push_back(0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    pairs.probe.insert(pairs.probe.end(), read[i].begin(), read[i].end());
    pairs.point.insert(pairs.point.end(), read[i].size(), static_cast<uint32_t>(i));
    pairs.begin.push_back(static_cast<uint32_t>(pairs.probe.size()));
  }
  sortByProbe(pairs, field.positions.size());
  return pairs;
}

Vec3d readingOffset(const FieldSnapshot& field, const QueryPoint& point, int probe) {
  const Vec3d bias =
      Vec3d(point.normal) * field.params.normal_bias - Vec3d(point.view) * field.params.view_bias;
  const float length_m = field.interpolant == PL_INTERPOLANT_SCATTERED
                             ? field.bias_lengths[static_cast<std::size_t>(probe)]
                             : field.lattice.bias_length;
  return Vec3d(point.position) + bias * static_cast<double>(length_m) -
         Vec3d(field.fetchPosition(probe));
}

Vec3f readingDirection(const FieldSnapshot& field, const QueryPoint& point, int probe,
                       double ahead_m) {
  if (field.modes.parallax == 0) return point.normal;
  const Vec3d offset = Vec3d(point.position) - Vec3d(field.fetchPosition(probe));
  return Vec3f(normalize(parallaxDirection(field.params, Vec3d(point.normal), offset, ahead_m)));
}

Vec3f queryPairs(const FieldSnapshot& field, const QueryParams<double>& params,
                 const QueryModes& modes, const ProbePairs& pairs,
                 std::span<const QueryPoint> points, std::size_t point,
                 std::span<const Vec3f> irradiance, std::span<const Vec2d> moments) {
  const std::size_t first = pairs.begin[point], count = pairs.begin[point + 1] - first;
  const PairView view{{field},
                      std::span(pairs.probe).subspan(first, count),
                      irradiance.subspan(first, count),
                      moments.subspan(first, count)};
  return Vec3f(queryView(view, params, modes, points[point]).irradiance);
}

}  // namespace probelab
