// SPDX-License-Identifier: GPL-3.0-or-later
// What parameters are judged by while they are tuned: fields of one lighting state each, held still
// in single precision, and points with path-traced truth.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "ddgi/snapshot.h"
#include "trace/embree_scene.h"
#include "trace/receivers.h"

namespace probelab {

// A receiver seen by one camera; one that several cameras see is several points.
struct TunePoint {
  QueryPoint query;
  double truth = 0;   // irradiance R = (A + B) / 2, luminance
  double weight = 0;  // the receiver's area, shared among its views; sums to 1 over the state
  double sigma = 0;   // of the truth, pooled over the split's receivers as for leaks
  bool dark = false;  // R < 0.1 of the mean: what is above the truth here is a light leak
};

struct FrozenState {
  std::string scene, state;
  FieldSnapshot field;
  std::vector<TunePoint> points;
  double power = 0;  // sum of weight * A * B, luminance
  double noise = 0;  // sum of weight * (A - B)^2 / 4, over power: the reference's share of the cost
  double mean = 0;   // sum of weight * R
  double weight = 1;  // of the state in the cost
};

// The field as it is now, with the receivers of `split`. Each point has the receiver's own view
// and, where that comes from a camera, those of the other `cameras` (local coordinates) that see
// it. Throws InputError where no receiver is of the split, where they have no truth, or where it is
// black; and where no probe is active.
FrozenState freezeState(ProbeField& field, const Receivers& receivers, Split split,
                        std::span<const Vec3f> cameras, const EmbreeScene& embree);
// The same of a snapshot.
FrozenState freezeState(FieldSnapshot field, const Receivers& receivers, Split split,
                        std::span<const Vec3f> cameras, const EmbreeScene& embree);

}  // namespace probelab
