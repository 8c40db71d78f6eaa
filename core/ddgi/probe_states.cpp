// SPDX-License-Identifier: Apache-2.0
#include "ddgi/probe_states.h"

#include <algorithm>
#include <limits>

#include "ddgi/directions.h"
#include "push_constants.h"

namespace probelab {
namespace {

struct StatePush {
  RayItems items;
  uint32_t ray_count, near_surface;
  float backface_threshold, front_distance;
  Vec3f spacing;
  float limit, bias_length;
  uint64_t surfaces;
};

// Traces the fixed rays of every probe, in batches, and runs `stage` on what they hit.
class FixedRays {
 public:
  FixedRays(GpuContext& context, RayBatch& batch, StageRecorder& recorder,
            const ProbeLayout& layout, const Params& params)
      : batch_(batch), recorder_(recorder), layout_(layout), params_(params) {
    std::vector<Vec3f> directions;
    for (const Vec3d& d : sphericalFibonacci(params.fixed_rays)) directions.emplace_back(d);
    directions_ = createBufferFrom(context, directions, MemoryUse::device, "fixed directions");
    homes_ = createBufferFrom(context, layout.positions, MemoryUse::device, "probe homes");
    positions_ = createBufferFrom(context, layout.positions, MemoryUse::device, "moved probes");
    active_ = createBuffer(context, layout.positions.size() * sizeof(uint32_t), MemoryUse::device,
                           "active probes");
    generate_ =
        makeStage(context, "ddgi/generate.comp.glsl", {{"PL_PROBE_LIST", "0"}},
                  {{"DIRECTIONS", &directions_}, {"PROBES", &positions_}}, sizeof(GeneratePush));
    if (!layout.lengths.empty()) {
      std::vector<float> bias;
      for (const ProbeLengths& lengths : layout.lengths) bias.push_back(lengths.bias);
      lengths_ = createBufferFrom(context, bias, MemoryUse::device, "probe lengths");
    }
    relocate_ = stateStage(context, "0", {{"HOMES", &homes_}, {"PROBES", &positions_}});
    classify_ = stateStage(context, "1", {{"ACTIVE", &active_}});
  }

  void relocate() { run("relocate", relocate_); }
  void classify() { run("classify", classify_); }
  const GpuBuffer& positions() const { return positions_; }
  const GpuBuffer& active() const { return active_; }

 private:
  Stage stateStage(GpuContext& context, const char* state, std::vector<StageInput> inputs) {
    inputs.push_back({"DIRECTIONS", &directions_});
    if (lengths_) inputs.push_back({"LENGTHS", &lengths_});
    return makeStage(context, "ddgi/probe_state.comp.glsl",
                     {{"PL_STATE", state}, {"PL_LOCAL_LENGTHS", lengths_ ? "1" : "0"}}, inputs,
                     sizeof(StatePush));
  }

  void run(const char* name, const Stage& stage) {
    const auto rays = static_cast<uint32_t>(params_.fixed_rays);
    const auto probes = static_cast<uint32_t>(layout_.positions.size());
    const uint32_t at_once = std::max(batch_.buffers().capacity / rays, 1u);
    for (uint32_t first = 0; first < probes; first += at_once) {
      const uint32_t count = std::min(at_once, probes - first);
      const RayItems items{count, first, 1, count};
      recorder_.run(name, generate_,
                    GeneratePush{count * rays, items, 0, batch_.buffers().rays.address()},
                    count * rays);
      batch_.traceSurfaces(recorder_, count * rays);
      recorder_.run(name, stage, push(items), count);
    }
    recorder_.flush();
  }

  StatePush push(const RayItems& items) const {
    const auto real = [](double value) { return static_cast<float>(value); };
    return {.items = items,
            .ray_count = static_cast<uint32_t>(params_.fixed_rays),
            .near_surface = params_.classification == PL_CLASSIFY_NEAR_SURFACE ? 1u : 0u,
            .backface_threshold = real(params_.backface_threshold),
            .front_distance = real(params_.relocation_front),
            .spacing = layout_.lattice.spacing,
            .limit = real(params_.relocation_limit),
            .bias_length = layout_.bias_length_m,
            .surfaces = batch_.buffers().surfaces.address()};
  }

  RayBatch& batch_;
  StageRecorder& recorder_;
  const ProbeLayout& layout_;
  const Params& params_;
  GpuBuffer directions_, homes_, positions_, active_;
  GpuBuffer lengths_;  // s_i, of scattered probes
  Stage generate_, relocate_, classify_;
};

}  // namespace

uint32_t ProbeStates::activeCount() const {
  return static_cast<uint32_t>(std::count(active.begin(), active.end(), uint8_t{1}));
}

ProbeStates initialStates(const ProbeLayout& layout) {
  return {layout.positions, std::vector<uint8_t>(layout.positions.size(), 1)};
}

std::vector<int> activeIndex(const ProbeLayout& layout, const ProbeStates& states) {
  std::vector<int> index = layout.probe_of_point;
  for (int& probe : index)
    if (probe >= 0 && states.active[static_cast<std::size_t>(probe)] == 0) probe = -1;
  return index;
}

std::vector<int> nearestIndex(const ProbeLayout& layout, const ProbeStates& states) {
  const std::vector<int> active = activeIndex(layout, states);
  std::vector<int> source(active.size(), -1);  // lattice point of the nearest active probe
  for (std::size_t i = 0; i < active.size(); ++i)
    if (active[i] >= 0) source[i] = static_cast<int>(i);
  const auto distanceSq = [&](std::size_t i, int from) {
    const Vec3f d = layout.lattice.position(static_cast<int>(i)) - layout.lattice.position(from);
    return dot(d, d);
  };
  // Neighbours hand on what they know until nothing gets nearer.
  const Vec3i n = layout.lattice.count;
  const int steps[3] = {1, n.x, n.x * n.y};
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t i = 0; i < source.size(); ++i) {
      const int at = static_cast<int>(i);
      const int place[3] = {at % n.x, at / n.x % n.y, at / (n.x * n.y)};
      for (std::size_t axis = 0; axis < 3; ++axis)
        for (const int side : {-1, 1}) {
          if (place[axis] + side < 0 || place[axis] + side >= n[axis]) continue;
          const int from = source[static_cast<std::size_t>(at + side * steps[axis])];
          if (from < 0 || from == source[i]) continue;
          const float ours =
              source[i] < 0 ? std::numeric_limits<float>::infinity() : distanceSq(i, source[i]);
          const float theirs = distanceSq(i, from);
          if (theirs > ours || (theirs == ours && from > source[i])) continue;
          source[i] = from;
          changed = true;
        }
    }
  }
  for (int& point : source)
    if (point >= 0) point = active[static_cast<std::size_t>(point)];
  return source;
}

bool isMoved(const ProbeLayout& layout, const ProbeStates& states) {
  for (std::size_t i = 0; i < layout.probe_of_point.size(); ++i) {
    const int probe = layout.probe_of_point[i];
    if (probe < 0) continue;
    const Vec3f home = layout.lattice.position(static_cast<int>(i));
    const Vec3f& place = states.positions[static_cast<std::size_t>(probe)];
    if (place.x != home.x || place.y != home.y || place.z != home.z) return true;
  }
  return false;
}

ProbeStates settleStates(GpuContext& context, RayBatch& batch, StageRecorder& recorder,
                         const ProbeLayout& layout, const Params& params) {
  ProbeStates states = initialStates(layout);
  if (params.relocation == 0 && params.classification == PL_CLASSIFY_NONE) return states;
  FixedRays rays(context, batch, recorder, layout, params);
  if (params.relocation != 0) {
    for (int i = 0; i < params.relocation_iterations; ++i) rays.relocate();
    states.positions = downloadArray<Vec3f>(context, rays.positions());
  }
  if (params.classification != PL_CLASSIFY_NONE) {
    rays.classify();
    const auto active = downloadArray<uint32_t>(context, rays.active());
    std::transform(active.begin(), active.end(), states.active.begin(),
                   [](uint32_t flag) { return flag != 0 ? uint8_t{1} : uint8_t{0}; });
  }
  return states;
}

}  // namespace probelab
