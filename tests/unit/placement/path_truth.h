// SPDX-License-Identifier: GPL-3.0-or-later
// A training's truth against path tracing of the same receivers.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "placement/training_data.h"
#include "trace/path_tracer.h"

namespace probelab::test {

struct TruthAgainstPaths {
  double ratio;  // of the means
  double nrmse;
};

// Of the training's state that `scene` is lit as; 512 samples a receiver.
inline TruthAgainstPaths againstPaths(const Training::Data& data, const Scene& scene,
                                      const EmbreeScene& embree, std::size_t state = 0) {
  std::vector<IrradiancePoint> points;
  for (const Receiver& r : data.receivers) points.push_back({r.position, r.normal});
  SampleBudget budget;
  budget.spp = 512;
  const IrradianceEstimate paths = estimateIrradiance(scene, embree, points, budget, 11);
  double ours = 0, theirs = 0, error = 0, power = 0;
  for (std::size_t r = 0; r < points.size(); ++r) {
    const double a = luminance(Vec3d(paths.a[r])) / M_PI, b = luminance(Vec3d(paths.b[r])) / M_PI;
    const double e = static_cast<double>(data.truth[r * data.stateCount() + state]);
    const double w = data.receivers[r].area;
    ours += w * e, theirs += w * 0.5 * (a + b);
    error += w * (e - a) * (e - b), power += w * a * b;
  }
  return {ours / theirs, std::sqrt(std::max(0.0, error / power))};
}

}  // namespace probelab::test
