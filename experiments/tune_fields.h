// SPDX-License-Identifier: GPL-3.0-or-later
// Fields of a tuning: run until converged, asked, and let go. Answers are kept, since tuning asks
// for the same parameters again when they are scored.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "ddgi/params.h"
#include "ddgi/snapshot.h"
#include "field_setup.h"
#include "gpu/context.h"
#include "program.h"
#include "tune_scene.h"
#include "tuning/frozen_state.h"

namespace probelab {

class TuneFields {
 public:
  // `gpu` and the options must outlive this.
  TuneFields(GpuContext& gpu, const FieldOptions& options, const Invocation& invocation)
      : gpu_(gpu), options_(options), invocation_(invocation) {}

  // The field's irradiance at every receiver of the state, [receiver].
  const std::vector<Vec3f>& estimates(const TunePart& part, const Params& params);
  // The same field with traced visibility.
  const std::vector<Vec3f>& exactEstimates(const TunePart& part, const Params& params);
  // Its train receivers over texels held still.
  std::shared_ptr<const FrozenState> frozen(const TunePart& part, const Params& params);
  FieldSnapshot snapshot(const TunePart& part, const Params& params);

  // A field of its own that has been run.
  std::unique_ptr<ProbeField> run(const TunePart& part, const Params& params);

  // Lets the texels go that were kept for `params`.
  void forget(const Params& params);

  int count() const { return count_; }  // fields that were run
  double seconds() const { return seconds_; }
  const std::string& tracer() const { return tracer_; }
  int activeProbes(const TuneScene& scene) const { return active_.at(&scene); }

 private:
  struct Answer {
    std::vector<Vec3f> estimates, exact;
    std::shared_ptr<const FrozenState> frozen;
  };
  using Key = std::pair<const TuneState*, std::string>;

  Answer& answer(const TunePart& part, const Params& params);
  template <class Use>
  void withField(const TunePart& part, const Params& params, Use use);

  GpuContext& gpu_;
  const FieldOptions& options_;
  const Invocation& invocation_;
  std::map<Key, Answer> answers_;
  std::map<const TuneScene*, int> active_;
  std::string tracer_;
  int count_ = 0;
  double seconds_ = 0;
};

}  // namespace probelab
