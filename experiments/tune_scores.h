// SPDX-License-Identifier: GPL-3.0-or-later
// How good tuned parameters are, beside others: numbers of `evaluate`, of fields that were run with
// them, under the lights that were tuned on and under others.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evaluation.h"
#include "json.h"
#include "metrics/bootstrap.h"
#include "metrics/error.h"
#include "tune_fields.h"
#include "tune_scene.h"

namespace probelab {

struct TuneSetting {
  std::string name;  // "from", "tuned", or a preset's
  Params params;
};

// Names of the two settings that are not presets.
inline constexpr const char* kFromSetting = "from";
inline constexpr const char* kTunedSetting = "tuned";

// Held-out receivers by the cubes of metrics/bootstrap.h.
class HeldoutBlocks {
 public:
  HeldoutBlocks(const Receivers& receivers, const Box3f& bounds);
  // "i,j,k", counted from the bounds' least corner.
  const std::vector<std::string>& names() const { return names_; }
  // blockSquaredErrors of estimates at all receivers, [block].
  std::vector<double> errors(const std::vector<Vec3f>& estimates) const;

 private:
  ReceiverColumns receivers_;
  SpatialBlocks blocks_;
  std::vector<std::string> names_;
};

// nrmse, smape, bias and leaks, with their noise_floor.
Json numbersJson(const ErrorReport& report);
Json intervalJson(const std::optional<RatioInterval>& interval);  // {ratio, low, high} or null

struct SettingScore {
  std::string name;
  ErrorReport train, heldout;         // by receivers
  std::optional<double> exact;        // held-out nrmse of the same field with traced visibility
  std::vector<double> blocks;         // held-out squared errors, [block of the part]
  std::optional<RatioInterval> gain;  // this one's held-out nrmse over that of the tuned
};

// Of one state of one scene.
struct PartScore {
  TunePart part;
  std::vector<std::string> blocks;  // HeldoutBlocks::names
  std::vector<SettingScore> settings;
  const SettingScore& of(const std::string& name) const;
};

PartScore scorePart(TuneFields& fields, const TunePart& part,
                    const std::vector<TuneSetting>& settings);

// The share of what traced visibility would take off the error of `from` that tuning takes off;
// null where that is less than 5 % of it.
std::optional<double> gapClosed(const PartScore& score);

// Errors of others over those of the tuned, on held-out receivers.
struct GainSummary {
  std::string against;      // a setting's name, or "best" for the least error of the presets
  bool same_lights = true;  // those tuned on; else the held-out ones
  double geometric_mean = 0, least = 0, most = 0;  // over scenes; a scene's is that of its states
  int scenes = 0;
};
std::vector<GainSummary> summarizeGains(const std::vector<PartScore>& scores,
                                        const std::vector<std::string>& presets);

// {scene, state, lights, exact, gap_closed, settings: [{setting, train, heldout, gain}]}; with
// `blocks` the held-out errors by block too.
Json toJson(const PartScore& score, bool blocks);
Json toJson(const GainSummary& summary);

// Tables for the terminal.
std::string formatScores(const std::vector<PartScore>& scores);
std::string formatGains(const std::vector<GainSummary>& gains);

}  // namespace probelab
