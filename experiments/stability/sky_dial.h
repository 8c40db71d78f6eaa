// SPDX-License-Identifier: GPL-3.0-or-later
// Light that can be chosen anew for every update: one probe under a sky a (1 + b d.z), one ray an
// update, so that all texels see what that ray sees, in [a (1 - b), a (1 + b)].
#pragma once

#include <memory>

#include "workbench.h"

namespace probelab {

class SkyDial {
 public:
  SkyDial(const Vec3f& a, float b);
  // `params` without visibility and with one ray.
  std::unique_ptr<ProbeField> field(Workbench& bench, Params params) const;
  // What the ray of a rotation brings, and the rotation, of the first few thousand, that brings
  // what is nearest to `share` x a.
  Vec3d radiance(uint64_t rotation) const;
  uint64_t rotationFor(double share) const;

 private:
  Vec3f a_;
  float b_;
  BuiltScene scene_;
};

// Mean over the stored texels of a channel's linear radiance.
double meanRadiance(ProbeField& field, std::size_t channel = 1);

}  // namespace probelab
