// SPDX-License-Identifier: GPL-3.0-or-later
// The stability cases that need no special scene, on a user's own: what moves nrmse though it must
// not, and so which of its digits can be trusted.
#pragma once

#include <string>
#include <vector>

#include "field_options.h"
#include "field_setup.h"
#include "json.h"
#include "program.h"
#include "scene_options.h"
#include "truth.h"

namespace probelab {

struct SceneStabilityOptions {
  SceneOptions scene;
  FieldOptions field;
  TruthOptions truth;
  std::string tracer = "both";  // embree | rayquery | both
};

// The scene moved by `shift`, scaled and mirrored at x = 0, in that order from the last: point and
// spot lights scale^2 times as bright, so irradiance stays what it is. One lighting state is left.
struct SceneMap {
  bool mirror = false;
  float scale = 1;
  Vec3f shift;
  Vec3f point(Vec3f p) const;
  Vec3f direction(Vec3f d) const;
};
Scene mappedScene(const Scene& scene, const SceneMap& map);

// {"scene", "nrmse", "digits", "trusted", "spread", "cases": [...]}; rows as of the hard-case
// suite, with "change", the difference in nrmse. `name` as of --case.
Json runSceneStability(const SceneStabilityOptions& options, const std::string& name,
                       const Invocation& invocation);

// Significant digits of a value whose rounding, half a unit of the last one, is not below `spread`.
int trustedDigits(double value, double spread);

}  // namespace probelab
