// SPDX-License-Identifier: GPL-3.0-or-later
#include "stability/curves.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/suggest.h"
#include "base/timer.h"
#include "stability/suite.h"
#include "workbench.h"

namespace probelab {
namespace {

constexpr double kAccuracy = 0.1;  // of a breaking point, relative

// Along points that lead away from the easy one.
std::optional<double> breakAlong(Workbench& bench, const CurvePlan& plan,
                                 const std::vector<CurvePoint>& way) {
  const auto holds = [&](double error) { return error <= plan.bound; };  // so NaN does not
  for (std::size_t i = 0; i < way.size(); ++i) {
    if (holds(way[i].error)) continue;
    if (i == 0) return way[i].x;
    return breakingPoint(
        way[i - 1].x, way[i].x, [&](double x) { return holds(plan.error(bench, x)); }, kAccuracy);
  }
  return std::nullopt;
}

std::string panelOf(const CurvePlan& plan) { return plan.id.substr(0, plan.id.find('.')); }

}  // namespace

std::vector<CurvePlan> planCurves(const std::string& name) {
  std::vector<CurvePlan> planned;
  std::vector<std::string> known, panels;
  for (CurvePlan& plan : precisionCurves()) {
    known.push_back(plan.id);
    const std::string panel = panelOf(plan);
    if (std::ranges::find(panels, panel) == panels.end()) panels.push_back(panel);
    if (matchesCase(plan.id, name)) planned.push_back(std::move(plan));
  }
  if (!planned.empty()) return planned;
  const std::string nearest = nearestName(name, known);
  if (!nearest.empty())
    throwInput("--case: no curve is called '{}', did you mean '{}'?", name, nearest);
  throwInput("--case: no curve is called '{}'; panels are: {}", name, fmt::join(panels, ", "));
}

Curve measureCurve(Workbench& bench, const CurvePlan& plan) {
  const Timer timer;
  Curve curve{plan, {}, {}, {}, 0};
  std::vector<CurvePoint> below, above;
  for (const double x : plan.xs) {
    throwIfInterrupted();
    const CurvePoint point{x, plan.error(bench, x)};
    curve.points.push_back(point);
    if (x <= plan.easy) below.insert(below.begin(), point);
    if (x >= plan.easy) above.push_back(point);
  }
  if (below.size() > 1) curve.breaks_below = breakAlong(bench, plan, below);
  if (above.size() > 1) curve.breaks_above = breakAlong(bench, plan, above);
  curve.seconds = timer.seconds();
  return curve;
}

std::vector<Curve> runCurves(GpuContext& gpu, const std::vector<CurvePlan>& planned,
                             const std::function<void(const Curve&)>& on_curve) {
  Workbench bench(gpu);
  std::vector<Curve> curves;
  for (const CurvePlan& plan : planned) {
    if (plan.tracer == "rayquery" && !gpu.info().ray_query) continue;
    curves.push_back(measureCurve(bench, plan));
    if (on_curve) on_curve(curves.back());
  }
  return curves;
}

}  // namespace probelab
