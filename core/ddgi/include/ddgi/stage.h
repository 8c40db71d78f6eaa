// SPDX-License-Identifier: Apache-2.0
// A compute stage: a pipeline with its buffers by name, and the recorder that runs and times
// stages.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "gpu/acceleration_structure.h"
#include "gpu/buffer.h"
#include "gpu/commands.h"
#include "gpu/context.h"
#include "gpu/pipeline.h"

namespace probelab {

constexpr uint32_t kStageGroupSize = 64;  // of core/shaders/ddgi/stage.glsl

using Defines = std::vector<std::pair<std::string, std::string>>;

// A buffer under the name that the shader binds it by: "RAYS" is BIND_RAYS.
struct StageInput {
  std::string name;
  const GpuBuffer* buffer;
  bool uniform = false;  // a uniform buffer: small, and the same for all invocations
};

struct Stage {
  std::shared_ptr<const ComputePipeline> pipeline;
  std::vector<StageInput> inputs;
  const AccelerationStructure* acceleration_structure = nullptr;

  // The same pipeline with another buffer under `name`, which must be one of the inputs.
  Stage with(const std::string& name, const GpuBuffer& buffer) const;
};

// Compiles core/shaders/<shader>; each input's binding is its place in the list.
Stage makeStage(GpuContext& context, const std::string& shader, Defines defines,
                std::vector<StageInput> inputs, uint32_t push_bytes,
                const AccelerationStructure* acceleration_structure = nullptr);

// Records dispatches, each followed by a barrier and timed under its stage's name. Work on the host
// (the Embree tracer) waits for what was recorded and is timed by the steady clock.
class StageRecorder {
 public:
  explicit StageRecorder(GpuContext& context);

  // One invocation an item, in workgroups of kStageGroupSize; or a number of workgroups.
  template <class Push>
  void run(const std::string& name, const Stage& stage, const Push& push, uint32_t items) {
    runGroups(name, stage, push, groupCount(items, kStageGroupSize));
  }
  template <class Push>
  void runGroups(const std::string& name, const Stage& stage, const Push& push, uint32_t groups_x,
                 uint32_t groups_y = 1) {
    dispatch(name, stage, pushBytes(push), groups_x, groups_y);
  }
  void onHost(const std::string& name, const std::function<void()>& work);
  // Submits what was recorded and waits for it.
  void flush();

  // Milliseconds a stage since the last reset; device stages count once flushed.
  const std::map<std::string, double>& milliseconds() const { return milliseconds_; }
  void resetTimes() { milliseconds_.clear(); }

 private:
  void dispatch(const std::string& name, const Stage& stage, std::span<const std::byte> push,
                uint32_t groups_x, uint32_t groups_y);

  Commands commands_;
  bool recording_ = false;
  std::vector<std::string> recorded_;  // names of the stages between the timestamps, in order
  std::map<std::string, double> milliseconds_;
};

}  // namespace probelab
