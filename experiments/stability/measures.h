// SPDX-License-Identifier: GPL-3.0-or-later
// Errors over one quantity each: cases of the suite judge them at a place, curves.h over a range.
#pragma once

#include "workbench.h"

namespace probelab {

// A room of 4 m with a pillar that emits and a lamp, traced by 64 rays a probe: E at 100 places
// of the room. Scaled, and then moved by as much along every axis; `rebased`: read from a file
// whose node lies so far away, so that the loader takes the distance into the scene's origin.
struct PillarPlace {
  double scale = 1;
  double metres = 0;
  bool rebased = false;
  uint32_t samples = 64;  // of the path tracer
};
Answers pillarAnswers(Workbench& bench, const CaseVariant& variant, Params params,
                      const PillarPlace& place);
// Root of the summed squares of the differences over that of the values of `base`.
double rmsDifference(const Answers& answers, const Answers& base);
// Difference of the sums over that of `base`.
double meanDifference(const Answers& answers, const Answers& base);

// Relative error of a furnace of 2 m that lies `metres` from the local origin on every axis.
double shiftedError(Workbench& bench, const CaseVariant& variant, double metres);

// A bright room (radiance 1) and a dark one, each 4 spacings deep, with a wall of `thickness`
// between them; 0 is a single sheet that both see. `metres`: from the local origin, along x.
Scene twoRooms(double thickness, double albedo, double spacing = 0.5, double metres = 0);
// Mean share of the bright room's irradiance that shows behind the wall, whose probes stand half a
// spacing from its middle; by the path tracer for the variant "reference".
double wallLeak(Workbench& bench, const CaseVariant& variant, const Params& params,
                double thickness, double spacing, double metres = 0);

// A bright room (radiance 1) and one of radiance `dark` with 1 m of wall: share of the bright one's
// radiance half-way between the columns of probes.
double leakedShare(Workbench& bench, Params params, double dark);

// Closed boxes of radiance `x` and up to 4 % less beside one of radiance 1, each with its probe:
// largest relative error of E at the former's, as the format stores it.
double storedError(Workbench& bench, const Params& params, double x);

// A furnace of radiance 0.6 after as many bounces as leave 1 % of it, or 5,000: error of the mean
// of its E, relative.
double albedoError(Workbench& bench, const CaseVariant& variant, const Params& params,
                   double albedo);

}  // namespace probelab
