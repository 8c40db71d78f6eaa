// SPDX-License-Identifier: Apache-2.0
// Behind ComputePipeline and AccelerationStructure. Not exported.
#pragma once

#include "gpu/acceleration_structure.h"
#include "gpu/pipeline.h"
#include "vulkan_state.h"

namespace probelab {

struct PipelineState {
  std::string name;
  PipelineOptions options;
  std::vector<std::uint32_t> spirv;
  Handle<VkDescriptorSetLayout> set_layout;
  Handle<VkPipelineLayout> layout;
  Handle<VkPipeline> pipeline;
};

struct AccelerationState {
  GpuBuffer bottom_memory, top_memory;
  Handle<VkAccelerationStructureKHR> bottom, top;
  GpuBuffer first_triangles;
  std::uint32_t geometry_count = 0;
};

}  // namespace probelab
