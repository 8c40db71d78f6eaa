// SPDX-License-Identifier: Apache-2.0
// Where the probes are and which of them are active: relocation and classification by rays that
// never turn.
#pragma once

#include <cstdint>
#include <vector>

#include "ddgi/constants.h"
#include "ddgi/layout.h"
#include "ddgi/ray_batch.h"

namespace probelab {

struct ProbeStates {
  std::vector<Vec3f> positions;  // [probe], local metres
  std::vector<uint8_t> active;   // [probe]
  uint32_t activeCount() const;
};

// As the layout has them: all active.
ProbeStates initialStates(const ProbeLayout& layout);

// Of a lattice, as are the next two. [lattice point]: the stored and active probe, -1: none.
std::vector<int> activeIndex(const ProbeLayout& layout, const ProbeStates& states);

// [lattice point]: the active probe whose lattice point is nearest in metres, the smaller index
// where two are; -1 when no probe is active.
std::vector<int> nearestIndex(const ProbeLayout& layout, const ProbeStates& states);

// True where some probe is not exactly on its lattice point.
bool isMoved(const ProbeLayout& layout, const ProbeStates& states);

// Runs relocation and then classification as the parameters say, on the device, through `batch`
// (its first probes * fixed_rays rays a batch). Stages "relocate" and "classify" in `recorder`.
ProbeStates settleStates(GpuContext& context, RayBatch& batch, StageRecorder& recorder,
                         const ProbeLayout& layout, const Params& params);

}  // namespace probelab
