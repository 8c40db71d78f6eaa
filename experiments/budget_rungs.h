// SPDX-License-Identifier: GPL-3.0-or-later
// The error budget: what a field would answer if only some of its stages were finite. Every rung
// takes one more stage as it is; the shared query reads all of them.
//
//   exact    path-traced probes at the query's very normal, traced visibility: what is left is
//   where
//            the probes are and how they are interpolated
//   moments  visibility from the moments of distances, evaluated in the very direction
//   texels   irradiance and moments through octahedral maps, from very many rays
//   rays     maps from the rays that the field shoots, in its own directions
//   formats  stored in the atlases' formats and encodings, with the biases that follow from them
//
// The field itself is the last rung: the light of the bounces read from the probes. Rules that
// decide what a probe stores (back faces, the clamp of distances) hold in all rungs;
// radiance_clamp, texture_footprint, flat_ray_share and a ray proxy act in the field alone.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "ddgi/layout.h"
#include "ddgi/params.h"
#include "ddgi/probe_states.h"
#include "shared/query.h"
#include "trace/path_tracer.h"

namespace probelab {

// The field that is taken apart.
struct BudgetField {
  const Scene& scene;
  const EmbreeScene& embree;
  const ProbeLayout& layout;
  const ProbeStates& states;
  const Params& params;
  uint64_t seed = 0;       // of the field's directions and of the paths
  int mixing_updates = 0;  // whose distances count and whose light does not
  int average_updates = 0;
};

struct BudgetRays {
  int exact = 16384;  // paths of a probe; half of them in either estimate. Even
  int lobe = 256;     // distances in a lobe about an exact direction
};

// Two estimates of the irradiance at points from independent paths, [point]; (first - A)(second -
// B) has neither the paths' noise nor that of a truth with halves A and B. What is finite in the
// rung itself (directions, texels) is the same in both.
struct RungEstimate {
  std::vector<Vec3f> first, second;
};

struct BudgetEstimates {
  RungEstimate exact, moments, texels, rays, formats;
  std::size_t probes_read = 0;  // by the points
  uint64_t bytes = 0;           // held at most, apart from the scene
  RayCount work;
};

// The same bytes for a seed whatever the number of threads. Probes that no point reads are left
// out; rays are summed as soon as they are traced. `progress` gets the share done. Throws
// NumericalError where a path is not finite, Interrupted on SIGINT.
BudgetEstimates estimateBudget(const BudgetField& field, const BudgetRays& rays,
                               std::span<const QueryPoint> points,
                               const std::function<void(double)>& progress = {});

}  // namespace probelab
