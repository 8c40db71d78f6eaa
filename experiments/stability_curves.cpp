// SPDX-License-Identifier: GPL-3.0-or-later
#include "stability_curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/build_info.h"
#include "base/error.h"
#include "base/interrupt.h"
#include "base/progress.h"
#include "device.h"
#include "provenance.h"
#include "stability/curves.h"
#include "table.h"

namespace probelab {
namespace {

// JSON has no NaN: an error that is none is null.
Json curveJson(const Curve& curve) {
  Json points = Json::array();
  for (const CurvePoint& p : curve.points)
    points.push_back({{"x", p.x},
                      {"error", std::isfinite(p.error) ? Json(p.error) : Json(nullptr)}});
  return {{"id", curve.plan.id},
          {"tracer", curve.plan.tracer},
          {"curve", curve.plan.what},
          {"axis", curve.plan.axis},
          {"measure", curve.plan.measure},
          {"bound", curve.plan.bound},
          {"easy", curve.plan.easy},
          {"breaks_below", optionalNumber(curve.breaks_below)},
          {"breaks_above", optionalNumber(curve.breaks_above)},
          {"points", points},
          {"seconds", curve.seconds}};
}

std::string pointText(const Json& point) {
  return point.is_null() ? "-" : fmt::format("{:.3g}", point.get<double>());
}

}  // namespace

Json runPrecision(const std::string& name, const std::string& tracer,
                  const Invocation& invocation) {
  std::vector<CurvePlan> planned = planCurves(name);
  std::erase_if(planned, [&](const CurvePlan& plan) {
    return tracer != "both" && plan.tracer != "reference" && plan.tracer != tracer;
  });
  if (planned.empty()) throwInput("--case {} has no curve of the tracer {}", name, tracer);
  Provenance provenance = makeProvenance(invocation);
  GpuContext gpu = openDevice(invocation, provenance);
  if (!gpu.info().ray_query && tracer != "embree")
    note(invocation, "{} has no ray query: curves of the tracer rayquery are left out",
         gpu.info().name);
  Progress progress("stability", static_cast<double>(planned.size()), invocation.common.quiet);
  Json curves = Json::array();
  const bool interrupted = endsInterrupted([&] {
    runCurves(gpu, planned, [&](const Curve& curve) {
      curves.push_back(curveJson(curve));
      progress.update(static_cast<double>(curves.size()));
    });
  });
  progress.finish();
  requireNoValidationMessages(gpu);
  provenance.tracer = tracer;
  return {{"curves", curves},
          {"interrupted", interrupted},
          {"device", gpu.info().name},
          {"version", buildInfo().version},
          {"provenance", toJson(provenance)}};
}

void printPrecision(const Json& result) {
  TextTable table({"curve", "bound", "breaks below", "breaks above", "largest error"});
  std::string axis;
  for (const Json& curve : result["curves"]) {
    if (curve["axis"] != axis) {
      axis = curve["axis"].get<std::string>();
      table.addRow({axis + ":"});
    }
    double worst = 0;
    for (const Json& p : curve["points"])
      worst = p["error"].is_null() || std::isnan(worst) ? NAN
                                                        : std::max(worst, p["error"].get<double>());
    table.addRow({curve["id"].get<std::string>(), pointText(curve["bound"]),
                  pointText(curve["breaks_below"]), pointText(curve["breaks_above"]),
                  formatNumber(worst)});
  }
  fmt::print("{}", table.text());
}

}  // namespace probelab
