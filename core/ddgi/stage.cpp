// SPDX-License-Identifier: Apache-2.0
#include "ddgi/stage.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/timer.h"

namespace probelab {
namespace {
constexpr uint32_t kMaxTimestamps = 64;  // two a stage; a full batch flushes
}  // namespace

Stage Stage::with(const std::string& name, const GpuBuffer& buffer) const {
  Stage copy = *this;
  for (StageInput& input : copy.inputs)
    if (input.name == name) {
      input.buffer = &buffer;
      return copy;
    }
  PROBELAB_CHECK(!"the stage has no such input");
  return copy;
}

Stage makeStage(GpuContext& context, const std::string& shader, Defines defines,
                std::vector<StageInput> inputs, uint32_t push_bytes,
                const AccelerationStructure* acceleration_structure) {
  PipelineOptions options;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (inputs[i].uniform) options.uniform_buffers |= std::uint64_t{1} << i;
    PROBELAB_CHECK(inputs[i].buffer != nullptr);
    defines.emplace_back("BIND_" + inputs[i].name, std::to_string(i));
  }
  if (acceleration_structure != nullptr)
    defines.emplace_back("BIND_ACCELERATION_STRUCTURE", std::to_string(inputs.size()));
  options.buffer_count = static_cast<uint32_t>(inputs.size());
  options.acceleration_structure = acceleration_structure != nullptr;
  options.push_constant_bytes = push_bytes;
  auto pipeline = std::make_shared<ComputePipeline>(
      createPipeline(context, {shader, std::move(defines), {}}, options));
  return {std::move(pipeline), std::move(inputs), acceleration_structure};
}

StageRecorder::StageRecorder(GpuContext& context) : commands_(context, kMaxTimestamps) {}

void StageRecorder::dispatch(const std::string& name, const Stage& stage,
                             std::span<const std::byte> push, uint32_t groups_x,
                             uint32_t groups_y) {
  if (groups_x == 0 || groups_y == 0) return;
  if (2 * (recorded_.size() + 1) > kMaxTimestamps) flush();
  if (!recording_) commands_.begin();
  recording_ = true;
  std::vector<const GpuBuffer*> buffers;
  for (const StageInput& input : stage.inputs) buffers.push_back(input.buffer);
  commands_.timestamp(name);
  commands_.dispatch(*stage.pipeline, buffers, stage.acceleration_structure, push, groups_x,
                     groups_y);
  commands_.barrier();
  commands_.timestamp(name);
  recorded_.push_back(name);
}

void StageRecorder::onHost(const std::string& name, const std::function<void()>& work) {
  flush();
  const Timer timer;
  work();
  milliseconds_[name] += timer.milliseconds();
}

void StageRecorder::flush() {
  if (!recording_) return;
  commands_.submitAndWait();
  recording_ = false;
  const std::vector<std::pair<std::string, double>> stamps = commands_.timestampsMs();
  PROBELAB_CHECK_EQ(stamps.size(), 2 * recorded_.size());
  for (std::size_t i = 0; i < recorded_.size(); ++i)
    milliseconds_[recorded_[i]] += stamps[2 * i + 1].second - stamps[2 * i].second;
  recorded_.clear();
}

}  // namespace probelab
