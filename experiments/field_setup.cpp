// SPDX-License-Identifier: GPL-3.0-or-later
#include "field_setup.h"

#include <nlohmann/json.hpp>
#include <sstream>

#include "base/progress.h"
#include "device.h"
#include "layout_source.h"
#include "tuning/values_file.h"

namespace probelab {
namespace {

constexpr std::size_t kWarmUpUpdates = 2;

}  // namespace

SceneSetup::SceneSetup(const SceneOptions& scene_options, const Invocation& invocation)
    : scene(loadScene(scene_options, invocation)),
      provenance(makeProvenance(invocation, scene)),
      embree(scene),
      gpu(openDevice(invocation, provenance)),
      reachability(findReachable(scene, embree)) {}

std::unique_ptr<ProbeField> makeField(SceneSetup& setup, const Params& params,
                                      const FieldPlan& plan) {
  FieldSettings settings;
  settings.seed = plan.seed;
  settings.tracer = parseTracer(plan.options.tracer);
  settings.accumulate = plan.accumulate;
  settings.working_set_bytes = plan.working_set_bytes;
  const Scene& scene = plan.proxy != nullptr ? plan.proxy->proxy.scene : setup.scene;
  const EmbreeScene& embree = plan.proxy != nullptr ? plan.proxy->embree : setup.embree;
  auto field =
      std::make_unique<ProbeField>(setup.gpu, scene, embree,
                                   obtainLayout({setup.scene, setup.embree, setup.reachability},
                                                plan.options, params, plan.seed, plan.cache),
                                   params, settings);
  setup.provenance.tracer = field->tracerName();
  return field;
}

FieldSetup::FieldSetup(Params wanted, const SceneOptions& scene_options,
                       const FieldOptions& options, const Invocation& invocation)
    : SceneSetup(scene_options, invocation),
      params(std::move(wanted)),
      proxy(makeProxySetup(scene, embree, options.ray_proxy_m, invocation.common.seed)) {
  field = makeField(*this, params,
                    {.options = options,
                     .seed = invocation.common.seed,
                     .cache = invocation.common.cache,
                     .proxy = proxy.get(),
                     .accumulate = options.mode == "converged"});
}

FieldRun runField(ProbeField& field, const FieldOptions& options, const Invocation& invocation,
                  const UpdateCallback& on_update) {
  FieldRun run;
  std::optional<TexelValues> values;  // read and checked before the work starts
  if (!options.values.empty()) {
    values = readValues(options.values);
    checkValues(*values, field, options.values);
  }
  std::unique_ptr<Progress> progress;  // once the number of updates is known
  const auto record = [&](int done, int total) {
    run.updates = done;
    run.update_ms.push_back(field.updateWallMs());
    for (const auto& [stage, ms] : field.updateStages()) run.stage_ms[stage].push_back(ms);
    if (total > 0 && !progress)
      progress = std::make_unique<Progress>("field", total, invocation.common.quiet);
    if (progress) progress->update(done);
    if (on_update) on_update(done, total);
  };
  if (options.mode == "temporal") {
    const int asked = options.updates.value_or(kDefaultTemporal);
    runTemporal(field, asked, record);
    run.stopped_early = run.updates < asked;
  } else {
    ConvergeOptions converge;
    converge.average = options.updates.value_or(kDefaultAveraged);
    run.converged = convergeField(field, converge, record);
    if (!run.converged->settled)
      note(invocation,
           "warning: the bounce series ended after {} updates with about {:.2g} % still to come; "
           "rounding=dithered or a finer irradiance_format gets nearer",
           run.converged->burn_in_updates, 100 * run.converged->remaining);
  }
  if (values) {
    applyValues(field, *values);
    run.values = ValuesUse{options.values, values->scene, values->state, values->params};
  }
  return run;
}

std::vector<double> afterWarmUp(const std::vector<double>& times) {
  const std::size_t skip = times.size() > 2 * kWarmUpUpdates ? kWarmUpUpdates : 0;
  return {times.begin() + static_cast<std::ptrdiff_t>(skip), times.end()};
}

Json toJson(const std::optional<ValuesUse>& values) {
  if (!values) return nullptr;
  return {{"file", values->file},
          {"scene", values->scene},
          {"state", values->state},
          {"params", values->params}};
}

std::string formatValues(const Json& values) {
  return fmt::format("{}, fitted to state {}", values["file"].get<std::string>(),
                     values["state"].get<std::string>());
}

Json toJson(const Params& params) {
  Json json = {{"name", params.name}};
  std::istringstream lines(describeParams(params));
  for (std::string line; std::getline(lines, line);) {
    const std::size_t equals = line.find(" = ");
    // Numbers, truth values and quoted names are written alike in TOML and JSON.
    if (equals != std::string::npos)
      json[line.substr(0, equals)] = Json::parse(line.substr(equals + 3));
  }
  return json;
}

}  // namespace probelab
