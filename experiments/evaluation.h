// SPDX-License-Identifier: GPL-3.0-or-later
// Scores a field at receivers and puts everything that is known about it under its fixed names.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "ddgi/probe_field.h"
#include "field_setup.h"
#include "json.h"
#include "metrics/error.h"
#include "trace/receivers.h"

namespace probelab {

// Which receivers count: held-out ones in published numbers, train ones for fitting.
enum class ScoredSplit { heldout, train, all };
ScoredSplit parseScoredSplit(const std::string& name);  // throws InputError
bool isScored(const Receiver& receiver, ScoredSplit split);

// The receivers of a split, column by column.
struct ReceiverColumns {
  std::vector<std::size_t> index;  // in the file
  std::vector<Vec3f> a, b, position;
  std::vector<float> area;
  std::vector<int> region, kind;  // kind is empty where any of them has none

  // Of estimates at all receivers of the file.
  std::vector<Vec3f> pick(const std::vector<Vec3f>& estimates) const;
  // References are kept, to `estimate` (of these receivers) as well.
  ReceiverSamples samples(const std::vector<Vec3f>& estimate) const;
};
ReceiverColumns receiverColumns(const Receivers& receivers, ScoredSplit split);

// The field's irradiance at every receiver, [receiver].
std::vector<Vec3f> queryReceivers(ProbeField& field, const Receivers& receivers);

// Errors over the receivers of the split. Throws InputError when there are none.
ErrorReport scoreEstimates(const std::vector<Vec3f>& estimates, const Receivers& receivers,
                           ScoredSplit split);

// blockSquaredErrors over all receivers: nrmse^2 by cubes of space.
std::vector<double> blockErrors(const std::vector<Vec3f>& estimates, const Receivers& receivers,
                                const Box3f& bounds);

// Area-weighted mean luminance of the truth over the receivers of the split.
double meanReference(const Receivers& receivers, ScoredSplit split);

// "error": the names of DESIGN section 6, noise_floor, surface, volume, resolved.
Json toJson(const ErrorReport& report);

// "speed": medians in ms, with p5 and p95 under "spread", and what
// relocation and classification took before the first update under "state_ms".
// "memory": bytes.
Json memoryJson(const ProbeField& field);

// "work": of an update.
Json workJson(const WorkCounts& work);

// "stability": rays and texels of all updates; queries at the receivers (`before` and `after`
// them), and apart from these the updates' own bounce queries.
Json stabilityJson(const Counters& before, const Counters& after);

// The points that query times are measured at: the receivers, repeated until they are many.
std::vector<QueryPoint> timedPoints(const Receivers& receivers);

Json measureSpeed(ProbeField& field, const FieldRun& run, const Receivers& receivers);

// The names of measureSpeed, toJson(ErrorReport) and stabilityJson without numbers, for
// checkRequirementNames.
Json scoreOutline();

// CSV: index,x,y,z,nx,ny,nz,kind,region,split,area,est_r..b,a_r..b,b_r..b in world coordinates.
std::string formatEstimates(const std::vector<Vec3f>& estimates, const Receivers& receivers,
                            const Scene& scene);

// Follows a temporal run: errors after 1, 2, 3, 4, 6, 8, 12, ... updates from black (powers of two
// and what lies between them), and flicker.
class TemporalRecord {
 public:
  TemporalRecord(ProbeField& field, const Receivers& receivers, ScoredSplit split)
      : field_(field), receivers_(receivers), split_(split) {}
  void add(int done);
  // {"nrmse_after": {"1": ...}, "updates_to_90": first update after which the mean over receivers
  // is at least 90 % of the last one, null when that is in the last quarter of the run and so no
  // settled level, "updates_to_95", "updates_to_99", "flicker": mean over receivers of sigma / mu
  // of luminance over the last 32 updates, by area, or null when fewer were run}.
  Json toJson() const;

 private:
  ProbeField& field_;
  const Receivers& receivers_;
  ScoredSplit split_;
  std::vector<std::pair<int, std::optional<double>>> nrmse_after_;
  std::vector<double> means_;              // of luminance by area, [update]
  std::deque<std::vector<Vec3f>> window_;  // estimates of the last updates
};

}  // namespace probelab
