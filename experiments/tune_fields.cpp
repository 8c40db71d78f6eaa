// SPDX-License-Identifier: GPL-3.0-or-later
#include "tune_fields.h"

#include "base/interrupt.h"
#include "base/timer.h"
#include "ddgi/run_field.h"
#include "device.h"
#include "evaluation.h"
#include "tuning/exact_visibility.h"

namespace probelab {

TuneFields::Answer& TuneFields::answer(const TunePart& part, const Params& params) {
  return answers_[{part.state, describeParams(params)}];
}

std::unique_ptr<ProbeField> TuneFields::run(const TunePart& part, const Params& params) {
  throwIfInterrupted();
  const Timer timer;
  FieldSettings settings;
  settings.seed = invocation_.common.seed;
  settings.tracer = parseTracer(options_.tracer);
  const ProxySetup* proxy = part.scene->proxy.get();
  const Scene seen =
      proxy != nullptr ? withState(proxy->proxy.scene, part.state->scene.state) : part.state->scene;
  auto field = std::make_unique<ProbeField>(gpu_, seen,
                                            proxy != nullptr ? proxy->embree : part.scene->embree,
                                            part.scene->layout, params, settings);
  runField(*field, options_, invocation_);
  requireNoValidationMessages(gpu_);
  tracer_ = field->tracerName();
  active_.try_emplace(part.scene, static_cast<int>(field->states().activeCount()));
  ++count_;
  seconds_ += timer.seconds();
  return field;
}

template <class Use>
void TuneFields::withField(const TunePart& part, const Params& params, Use use) {
  const std::unique_ptr<ProbeField> field = run(part, params);
  Answer& kept = answer(part, params);
  if (kept.estimates.empty()) kept.estimates = queryReceivers(*field, part.state->receivers);
  use(*field, kept);
}

const std::vector<Vec3f>& TuneFields::estimates(const TunePart& part, const Params& params) {
  Answer& kept = answer(part, params);
  if (kept.estimates.empty()) withField(part, params, [](ProbeField&, Answer&) {});
  return kept.estimates;
}

std::shared_ptr<const FrozenState> TuneFields::frozen(const TunePart& part, const Params& params) {
  Answer& kept = answer(part, params);
  if (!kept.frozen)
    withField(part, params, [&](ProbeField& field, Answer& a) {
      FrozenState state = freezeState(field, part.state->receivers, Split::train,
                                      part.scene->cameras(), part.scene->embree);
      state.scene = part.scene->scene.name;
      state.state = part.state->scene.state;
      a.frozen = std::make_shared<const FrozenState>(std::move(state));
    });
  return kept.frozen;
}

FieldSnapshot TuneFields::snapshot(const TunePart& part, const Params& params) {
  if (const Answer& kept = answer(part, params); kept.frozen) return kept.frozen->field;
  FieldSnapshot taken;
  withField(part, params, [&](ProbeField& field, Answer&) { taken = takeSnapshot(field); });
  return taken;
}

const std::vector<Vec3f>& TuneFields::exactEstimates(const TunePart& part, const Params& params) {
  Answer& kept = answer(part, params);
  if (!kept.exact.empty()) return kept.exact;
  std::vector<QueryPoint> points;
  for (const Receiver& r : part.state->receivers.points)
    points.push_back({r.position, r.normal, r.view});
  const FieldSnapshot field = snapshot(part, params);
  kept.exact = queryExactVisibility(field, params, points, part.scene->embree);
  return kept.exact;
}

void TuneFields::forget(const Params& params) {
  const std::string text = describeParams(params);
  for (auto& [key, kept] : answers_)
    if (key.second == text) kept.frozen.reset();
}

}  // namespace probelab
