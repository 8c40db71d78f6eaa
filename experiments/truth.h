// SPDX-License-Identifier: GPL-3.0-or-later
// Receivers with path-traced truth, for the commands that make or need them. Truth is expensive and
// deterministic, so it is kept in the cache under a hash of everything that it depends on.
#pragma once

#include <string>

#include "program.h"
#include "scene/scene.h"
#include "scene_options.h"
#include "trace/receivers.h"

namespace probelab {

// Part of the cache's key: raise it whenever the tracer or the receivers give other numbers.
inline constexpr int kTruthVersion = 2;

struct TruthOptions {
  int count = 4096;
  std::string points;  // CSV; empty: generated
  SamplingOptions sampling;
};
// --count, --points and the sampling options.
void addTruthOptions(CLI::App& app, TruthOptions& options);

struct Truth {
  Receivers receivers;
  bool from_cache = false;
};

// From the cache where it is there; else traced and, unless it was limited by time, put there.
Truth obtainTruth(const TruthOptions& options, const Scene& scene, const EmbreeScene& embree,
                  const Reachability& reachability, const Invocation& invocation);

}  // namespace probelab
