// SPDX-License-Identifier: GPL-3.0-or-later
#include "tuning/exact_visibility.h"

#include "base/parallel.h"
#include "field_view.h"
#include "shared/light.h"
#include "shared/offset.h"

namespace probelab {
namespace {

// Moments that make the query's Chebyshev bound 1 or 0 at any distance above 0.
const Vec2d kSeen(1e30, 1e60);
const Vec2d kHidden(0, 0);

// Of one point. The query fetches the moments only of probes with a weight in the interpolation,
// and all texels of a probe in a row, so a segment is traced once where it is needed.
struct ExactView : FieldView {
  const EmbreeScene& embree;
  const QueryPoint& point;
  mutable int traced = -1;    // probe
  mutable Vec2d answer = {};  // of that one

  Vec2d fetchMoments(int probe, int) const {
    if (probe != traced) answer = seesProbe(embree, point, fetchPosition(probe)) ? kSeen : kHidden;
    traced = probe;
    return answer;
  }
};

}  // namespace

bool seesProbe(const EmbreeScene& embree, const QueryPoint& point, const Vec3f& probe) {
  const Vec3f origin = offsetOrigin(pointWithoutTriangle(point.position, embree.extent()),
                                    point.normal, point.normal);
  const Vec3f offset = probe - origin;
  const float distance_m = length(offset);
  if (!(distance_m > 0)) return true;
  return !embree.occluded(Ray{origin, 0, offset / distance_m, distance_m * (1 - kLightGap)});
}

std::vector<Vec3f> queryExactVisibility(const FieldSnapshot& field, const Params& params,
                                        std::span<const QueryPoint> points,
                                        const EmbreeScene& embree) {
  QueryModes modes = viewModes(field, params);
  modes.visibility = 1;
  QueryParams<double> query = queryParams(params);
  query.chebyshev_power = 1;
  query.visibility_floor = query.variance_bias = query.variance_floor = 0;
  std::vector<Vec3f> results(points.size());
  parallelFor(points.size(), 64, [&](std::size_t begin, std::size_t end) {
    const FlushDenormals flush;
    for (std::size_t i = begin; i < end; ++i) {
      const ExactView view{{field}, embree, points[i]};
      results[i] = Vec3f(queryView(view, query, modes, points[i]).irradiance);
    }
  });
  return results;
}

}  // namespace probelab
