// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab stability SCENE --long-run N`: a field updated with hysteresis as often as an engine
// does in an hour, against the same field converged: memory, drift, stalls.
#pragma once

#include <span>
#include <vector>

#include "json.h"
#include "program.h"
#include "stability/suite.h"
#include "stability_scene.h"

namespace probelab {

constexpr int kLongRunStep = 2000;  // updates: a run is a multiple, so that its parts are equal

// What was seen over a part of the run; the parts are equally long.
struct LongBatch {
  int updates = 0;                // done at its end
  std::vector<double> estimates;  // mean over its samples of E's luminance, [receiver]
  double variance = 0;            // over its samples, mean over receivers by area
  double frozen = 0;   // share of receivers whose E is the same bits in all of its samples
  double update_ms = 0, slowest_ms = 0;  // median and longest
  double rss_mib = 0;                    // resident memory at its end
};

struct LongRun {
  std::vector<double> area;       // sum 1, [receiver]
  std::vector<double> converged;  // E's luminance from as many updates as a batch has
  std::vector<LongBatch> batches;
};

// Root of the mean square by area of a - b, over that of b.
double rmsDistance(const LongRun& run, std::span<const double> a, std::span<const double> b);

// Slope of a line through equally spaced values over its standard error; 0 where all are alike.
double trend(std::span<const double> values);

struct LongNumbers {
  double noise = 0;     // of E under hysteresis at any one time, rms over that of E
  double expected = 0;  // distance of a batch's mean from the converged field, by noise alone
  double farthest = 0;  // largest distance of a batch
  double drift = 0;     // trend() of the batches' means, in standard errors
  double grown_mib = 0;  // resident memory's steady growth over the batches after the first tenth
  double frozen = 0;    // largest of a batch
  double slowest = 0;   // slowest batch's median update over the fastest's
  double variance_ratio = 0;  // of the last quarter of the batches over that of the first
};
LongNumbers longNumbers(const LongRun& run);

// Rows "long.memory", "long.drift", "long.converged", "long.stall" of these numbers.
struct LongRow {
  const char *id, *title, *expectation;
  Measurement measured;
};
std::vector<LongRow> judgeLongRun(const LongNumbers& numbers);

// As runSceneStability, with "batches" and the numbers above beside "cases".
Json runLongRun(const SceneStabilityOptions& options, int updates, const Invocation& invocation);

}  // namespace probelab
