// SPDX-License-Identifier: Apache-2.0
// Command buffers, memory barriers between host and device, and waiting for the queue.
#include <limits>

#include "vulkan_state.h"

namespace probelab {
namespace {

std::vector<VkMappedMemoryRange> nonCoherentRanges(const VulkanState& state) {
  std::vector<VkMappedMemoryRange> ranges;
  for (const VkDeviceMemory memory : state.non_coherent) {
    VkMappedMemoryRange range{VK_STRUCTURE_TYPE_MAPPED_MEMORY_RANGE};
    range.memory = memory;
    range.size = VK_WHOLE_SIZE;
    ranges.push_back(range);
  }
  return ranges;
}

void recordMemoryBarrier(VkCommandBuffer commands, VkPipelineStageFlags2 to_stage,
                         VkAccessFlags2 to_access) {
  VkMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
  barrier.srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
  barrier.srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT;
  barrier.dstStageMask = to_stage;
  barrier.dstAccessMask = to_access;
  VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
  dependency.memoryBarrierCount = 1;
  dependency.pMemoryBarriers = &barrier;
  vkCmdPipelineBarrier2(commands, &dependency);
}

}  // namespace

CommandBuffer createCommandBuffer(const VulkanState& state, const std::string& name) {
  CommandBuffer result;
  VkCommandPoolCreateInfo pool_info{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
  pool_info.queueFamilyIndex = state.physical.queue_family;
  VkCommandPool pool = VK_NULL_HANDLE;
  checkVulkan(vkCreateCommandPool(state.device, &pool_info, nullptr, &pool), "vkCreateCommandPool");
  result.pool = {state.device, pool, vkDestroyCommandPool};

  VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
  allocate.commandPool = pool;
  allocate.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  allocate.commandBufferCount = 1;
  checkVulkan(vkAllocateCommandBuffers(state.device, &allocate, &result.commands),
              "vkAllocateCommandBuffers");

  VkFenceCreateInfo fence_info{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
  VkFence fence = VK_NULL_HANDLE;
  checkVulkan(vkCreateFence(state.device, &fence_info, nullptr, &fence), "vkCreateFence");
  result.fence = {state.device, fence, vkDestroyFence};
  setName(state, VK_OBJECT_TYPE_COMMAND_POOL, pool, name);
  setName(state, VK_OBJECT_TYPE_COMMAND_BUFFER, result.commands, name);
  setName(state, VK_OBJECT_TYPE_FENCE, fence, name);
  return result;
}

void beginCommands(const VulkanState& state, const CommandBuffer& commands) {
  checkVulkan(vkResetCommandPool(state.device, commands.pool.get(), 0), "vkResetCommandPool");
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  checkVulkan(vkBeginCommandBuffer(commands.commands, &begin), "vkBeginCommandBuffer");
  // A fence makes an earlier submission's writes available, only a barrier makes them visible.
  recordBarrier(commands);
}

void recordBarrier(const CommandBuffer& commands) {
  recordMemoryBarrier(commands.commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
                      VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT);
}

void recordLayout(const CommandBuffer& commands, ImageState& image, VkImageLayout layout) {
  VkImageMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
  barrier.srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
  barrier.srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT;
  barrier.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
  barrier.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
  barrier.oldLayout = image.layout;
  barrier.newLayout = layout;
  barrier.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.image = image.image.get();
  barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, image.size.layers};
  VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
  dependency.imageMemoryBarrierCount = 1;
  dependency.pImageMemoryBarriers = &barrier;
  vkCmdPipelineBarrier2(commands.commands, &dependency);
  image.layout = layout;
}

void submitCommands(const VulkanState& state, const CommandBuffer& commands) {
  recordMemoryBarrier(commands.commands, VK_PIPELINE_STAGE_2_HOST_BIT,
                      VK_ACCESS_2_HOST_READ_BIT | VK_ACCESS_2_HOST_WRITE_BIT);
  checkVulkan(vkEndCommandBuffer(commands.commands), "vkEndCommandBuffer");
  const std::vector<VkMappedMemoryRange> ranges = nonCoherentRanges(state);
  const auto range_count = static_cast<std::uint32_t>(ranges.size());
  if (range_count > 0)
    checkVulkan(vkFlushMappedMemoryRanges(state.device, range_count, ranges.data()),
                "vkFlushMappedMemoryRanges");

  VkCommandBufferSubmitInfo buffer{VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO};
  buffer.commandBuffer = commands.commands;
  VkSubmitInfo2 submit{VK_STRUCTURE_TYPE_SUBMIT_INFO_2};
  submit.commandBufferInfoCount = 1;
  submit.pCommandBufferInfos = &buffer;
  const VkFence fence = commands.fence.get();
  checkVulkan(vkQueueSubmit2(state.queue, 1, &submit, fence), "vkQueueSubmit2");
  checkVulkan(
      vkWaitForFences(state.device, 1, &fence, VK_TRUE, std::numeric_limits<std::uint64_t>::max()),
      "vkWaitForFences");
  checkVulkan(vkResetFences(state.device, 1, &fence), "vkResetFences");
  if (range_count > 0)
    checkVulkan(vkInvalidateMappedMemoryRanges(state.device, range_count, ranges.data()),
                "vkInvalidateMappedMemoryRanges");
}

}  // namespace probelab
