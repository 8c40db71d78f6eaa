// SPDX-License-Identifier: GPL-3.0-or-later
// Where precision goes: errors over a range of distances, scales, contrasts, walls and albedos, a
// curve a tracer, format and formula, and where each leaves its bound. `probelab stability
// --curves` prints them, scripts/precision.py draws them.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "gpu/context.h"

namespace probelab {

struct CurvePoint {
  double x = 0, error = 0;
};

class Workbench;

struct CurvePlan {
  std::string id;       // "distance.embree": the panel and the curve
  std::string tracer;   // embree | rayquery | reference
  std::string what;     // the curve, a few words
  std::string axis;     // what x is, with its unit
  std::string measure;  // what the error is
  double bound = 0;     // above it the curve has broken
  double easy = 1;      // the x at which it is easiest; the ends of xs are hard
  std::vector<double> xs;  // rising
  std::function<double(Workbench& bench, double x)> error;
};

// In order of their panels; ids are unique.
std::vector<CurvePlan> precisionCurves();

// As planRows of suite.h does for cases.
std::vector<CurvePlan> planCurves(const std::string& name);

struct Curve {
  CurvePlan plan;
  std::vector<CurvePoint> points;
  // Where the error first exceeds the bound on the way from `easy` down and up, to 10 %; empty
  // where it holds to the end. `easy` itself where not even that holds.
  std::optional<double> breaks_below, breaks_above;
  double seconds = 0;
};

Curve measureCurve(Workbench& bench, const CurvePlan& plan);

// Curves of the tracer rayquery are left out where the device has none. `on_curve` comes after
// each.
std::vector<Curve> runCurves(GpuContext& gpu, const std::vector<CurvePlan>& planned,
                             const std::function<void(const Curve&)>& on_curve = {});

}  // namespace probelab
