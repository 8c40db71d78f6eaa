// SPDX-License-Identifier: Apache-2.0
// One compute shader with its bindings: set 0, storage buffers 0 .. n-1, then the acceleration
// structure, the storage images and the sampled images, as far as there are any; push constants.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "gpu/context.h"
#include "gpu/shader.h"

namespace probelab {

struct PipelineOptions {
  std::uint32_t buffer_count = 0;         // storage buffers at bindings 0 .. buffer_count - 1
  bool acceleration_structure = false;    // at binding buffer_count
  std::uint32_t push_constant_bytes = 0;  // a multiple of 4; at least 128 are there everywhere
  std::uint32_t storage_image_count = 0;  // image2DArray, at the bindings after those
  std::uint32_t sampled_image_count = 0;  // sampler2DArray, at the last bindings
  std::uint64_t uniform_buffers = 0;      // bit i: buffer i is a uniform one, of at most 16 KiB
};

constexpr bool isUniformBuffer(const PipelineOptions& options, std::uint32_t binding) {
  return (options.uniform_buffers >> binding & 1) != 0;
}

struct PipelineState;

class ComputePipeline {
 public:
  ComputePipeline();  // empty: only assignment and destruction are allowed
  explicit ComputePipeline(std::unique_ptr<PipelineState> state);
  ComputePipeline(ComputePipeline&&) noexcept;
  ComputePipeline& operator=(ComputePipeline&&) noexcept;
  ~ComputePipeline();

  explicit operator bool() const { return state_ != nullptr; }
  const std::string& name() const;
  const PipelineOptions& options() const;
  std::span<const std::uint32_t> spirv() const;  // after optimisation
  PipelineState& state() const { return *state_; }

 private:
  std::unique_ptr<PipelineState> state_;
};

// DeviceError when the device's limits (bindings, push constants, images) are exceeded or ray
// queries are asked for and not there; compileShader's errors.
ComputePipeline createPipeline(GpuContext& context, const ShaderSource& source,
                               const PipelineOptions& options);

}  // namespace probelab
