// SPDX-License-Identifier: Apache-2.0
#include "gpu/commands.h"

#include <algorithm>
#include <limits>

#include "pipeline_state.h"

namespace probelab {

struct CommandsState {
  VulkanState* vulkan = nullptr;
  CommandBuffer commands;
  bool recording = false;
  // Descriptor sets of the current recording; a full pool is followed by the next, all are reset
  // together by begin().
  std::vector<Handle<VkDescriptorPool>> pools;
  std::size_t pool = 0;
  Handle<VkQueryPool> queries;
  std::uint32_t max_timestamps = 0;
  std::vector<std::string> labels;
};

namespace {

constexpr std::uint32_t kSetsPerPool = 64;
constexpr std::uint32_t kBuffersPerPool = 1024;

VkDescriptorPool addPool(CommandsState& state, std::uint32_t buffers) {
  std::vector<VkDescriptorPoolSize> sizes{
      {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, std::max(buffers, kBuffersPerPool)}};
  if (state.vulkan->physical.info.ray_query)
    sizes.push_back({VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, kSetsPerPool});
  VkDescriptorPoolCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
  info.maxSets = kSetsPerPool;
  info.poolSizeCount = static_cast<std::uint32_t>(sizes.size());
  info.pPoolSizes = sizes.data();
  VkDescriptorPool pool = VK_NULL_HANDLE;
  checkVulkan(vkCreateDescriptorPool(state.vulkan->device, &info, nullptr, &pool),
              "vkCreateDescriptorPool");
  state.pools.emplace_back(state.vulkan->device, pool, vkDestroyDescriptorPool);
  return pool;
}

VkDescriptorSet allocateSet(CommandsState& state, const PipelineState& pipeline) {
  VkDescriptorSetAllocateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
  info.descriptorSetCount = 1;
  info.pSetLayouts = pipeline.set_layout.pointer();
  VkDescriptorSet set = VK_NULL_HANDLE;
  for (; state.pool < state.pools.size(); ++state.pool) {
    info.descriptorPool = state.pools[state.pool].get();
    const VkResult result = vkAllocateDescriptorSets(state.vulkan->device, &info, &set);
    if (result == VK_SUCCESS) return set;
    if (result != VK_ERROR_OUT_OF_POOL_MEMORY && result != VK_ERROR_FRAGMENTED_POOL)
      checkVulkan(result, "vkAllocateDescriptorSets", pipeline.name);
  }
  info.descriptorPool = addPool(state, pipeline.options.buffer_count);
  checkVulkan(vkAllocateDescriptorSets(state.vulkan->device, &info, &set),
              "vkAllocateDescriptorSets", pipeline.name);
  return set;
}

void writeSet(const CommandsState& state, VkDescriptorSet set,
              std::span<const GpuBuffer* const> buffers, const AccelerationStructure* as) {
  const VkDeviceSize max_range = state.vulkan->physical.info.max_storage_buffer_range;
  std::vector<VkDescriptorBufferInfo> infos(buffers.size());
  std::vector<VkWriteDescriptorSet> writes;
  VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
  write.dstSet = set;
  write.descriptorCount = 1;
  for (std::size_t i = 0; i < buffers.size(); ++i) {
    if (buffers[i] == nullptr) continue;
    const BufferState& buffer = buffers[i]->state();
    infos[i] = {buffer.buffer.get(), 0, std::min<VkDeviceSize>(buffer.allocated, max_range)};
    write.dstBinding = static_cast<std::uint32_t>(i);
    write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    write.pBufferInfo = &infos[i];
    writes.push_back(write);
  }
  VkWriteDescriptorSetAccelerationStructureKHR as_info{
      VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR};
  if (as != nullptr) {
    as_info.accelerationStructureCount = 1;
    as_info.pAccelerationStructures = as->state().top.pointer();
    write.pNext = &as_info;
    write.dstBinding = static_cast<std::uint32_t>(buffers.size());
    write.descriptorType = VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR;
    write.pBufferInfo = nullptr;
    writes.push_back(write);
  }
  vkUpdateDescriptorSets(state.vulkan->device, static_cast<std::uint32_t>(writes.size()),
                         writes.data(), 0, nullptr);
}

void checkGroups(const DeviceInfo& device, const std::string& name,
                 const std::array<std::uint32_t, 3>& groups) {
  for (std::size_t i = 0; i < 3; ++i)
    if (groups[i] > device.max_workgroup_count[i])
      throw DeviceError(fmt::format(
          "shader {} is dispatched with {} workgroups in {}, the device allows {}; use smaller "
          "batches",
          name, groups[i], "xyz"[i], device.max_workgroup_count[i]));
}

VkQueryPool createQueries(const VulkanState& state, std::uint32_t count) {
  VkQueryPoolCreateInfo info{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
  info.queryType = VK_QUERY_TYPE_TIMESTAMP;
  info.queryCount = count;
  VkQueryPool pool = VK_NULL_HANDLE;
  checkVulkan(vkCreateQueryPool(state.device, &info, nullptr, &pool), "vkCreateQueryPool");
  return pool;
}

}  // namespace

std::uint32_t groupCount(std::uint64_t items, std::uint32_t group_size) {
  const std::uint64_t groups = items / group_size + (items % group_size != 0);
  PROBELAB_CHECK(groups <= std::numeric_limits<std::uint32_t>::max());
  return static_cast<std::uint32_t>(groups);
}

Commands::Commands(GpuContext& context, std::uint32_t max_timestamps)
    : state_(std::make_unique<CommandsState>()) {
  state_->vulkan = &context.state();
  state_->commands = createCommandBuffer(*state_->vulkan, "commands");
  state_->max_timestamps = max_timestamps;
  if (max_timestamps > 0)
    state_->queries = {state_->vulkan->device, createQueries(*state_->vulkan, max_timestamps),
                       vkDestroyQueryPool};
}
Commands::Commands(Commands&&) noexcept = default;
Commands& Commands::operator=(Commands&&) noexcept = default;
Commands::~Commands() = default;

void Commands::begin() {
  CommandsState& s = *state_;
  for (const Handle<VkDescriptorPool>& pool : s.pools)
    checkVulkan(vkResetDescriptorPool(s.vulkan->device, pool.get(), 0), "vkResetDescriptorPool");
  s.pool = 0;
  s.labels.clear();
  beginCommands(*s.vulkan, s.commands);
  if (s.queries) vkCmdResetQueryPool(s.commands.commands, s.queries.get(), 0, s.max_timestamps);
  s.recording = true;
}

void Commands::dispatch(const ComputePipeline& pipeline, std::span<const GpuBuffer* const> buffers,
                        const AccelerationStructure* as, std::span<const std::byte> push,
                        std::uint32_t groups_x, std::uint32_t groups_y, std::uint32_t groups_z) {
  CommandsState& s = *state_;
  const PipelineState& p = pipeline.state();
  PROBELAB_CHECK(s.recording);
  PROBELAB_CHECK_EQ(buffers.size(), p.options.buffer_count);
  PROBELAB_CHECK_EQ(as != nullptr, p.options.acceleration_structure);
  PROBELAB_CHECK_EQ(push.size(), p.options.push_constant_bytes);
  checkGroups(s.vulkan->physical.info, p.name, {groups_x, groups_y, groups_z});
  if (groups_x == 0 || groups_y == 0 || groups_z == 0) return;
  const VkCommandBuffer commands = s.commands.commands;
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, p.pipeline.get());
  if (!buffers.empty() || as != nullptr) {
    const VkDescriptorSet set = allocateSet(s, p);
    writeSet(s, set, buffers, as);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, p.layout.get(), 0, 1, &set, 0,
                            nullptr);
  }
  if (!push.empty())
    vkCmdPushConstants(commands, p.layout.get(), VK_SHADER_STAGE_COMPUTE_BIT, 0,
                       static_cast<std::uint32_t>(push.size()), push.data());
  vkCmdDispatch(commands, groups_x, groups_y, groups_z);
}

void Commands::barrier() {
  PROBELAB_CHECK(state_->recording);
  recordBarrier(state_->commands);
}

void Commands::fill(GpuBuffer& buffer, std::uint32_t word, std::size_t offset, std::size_t bytes) {
  PROBELAB_CHECK(state_->recording);
  PROBELAB_CHECK(offset % 4 == 0 && bytes % 4 == 0);
  PROBELAB_CHECK(offset <= buffer.size() && bytes <= buffer.size() - offset);
  if (bytes == 0) return;
  vkCmdFillBuffer(state_->commands.commands, buffer.state().buffer.get(), offset, bytes, word);
}

void Commands::fill(GpuBuffer& buffer, std::uint32_t word) { fill(buffer, word, 0, buffer.size()); }

void Commands::copy(const GpuBuffer& from, GpuBuffer& to, std::size_t bytes,
                    std::size_t from_offset, std::size_t to_offset) {
  PROBELAB_CHECK(state_->recording);
  PROBELAB_CHECK(from_offset <= from.size() && bytes <= from.size() - from_offset);
  PROBELAB_CHECK(to_offset <= to.size() && bytes <= to.size() - to_offset);
  if (bytes == 0) return;
  const VkBufferCopy region{from_offset, to_offset, bytes};
  vkCmdCopyBuffer(state_->commands.commands, from.state().buffer.get(), to.state().buffer.get(), 1,
                  &region);
}

void Commands::timestamp(std::string label) {
  CommandsState& s = *state_;
  PROBELAB_CHECK(s.recording);
  PROBELAB_CHECK(s.labels.size() < s.max_timestamps);
  vkCmdWriteTimestamp2(s.commands.commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, s.queries.get(),
                       static_cast<std::uint32_t>(s.labels.size()));
  s.labels.push_back(std::move(label));
}

void Commands::submitAndWait() {
  PROBELAB_CHECK(state_->recording);
  state_->recording = false;
  submitCommands(*state_->vulkan, state_->commands);
}

std::vector<std::pair<std::string, double>> Commands::timestampsMs() const {
  const CommandsState& s = *state_;
  PROBELAB_CHECK(!s.recording);
  const std::size_t count = s.labels.size();
  std::vector<std::pair<std::string, double>> result;
  if (count == 0) return result;
  std::vector<std::uint64_t> ticks(count);
  checkVulkan(
      vkGetQueryPoolResults(s.vulkan->device, s.queries.get(), 0, static_cast<std::uint32_t>(count),
                            count * sizeof(ticks[0]), ticks.data(), sizeof(ticks[0]),
                            VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
      "vkGetQueryPoolResults");
  const DeviceInfo& info = s.vulkan->physical.info;
  const std::vector<double> times = millisecondsFromTicks(
      ticks, info.timestamp_valid_bits, static_cast<double>(info.timestamp_period_ns));
  for (std::size_t i = 0; i < count; ++i) result.emplace_back(s.labels[i], times[i]);
  return result;
}

std::vector<double> millisecondsFromTicks(std::span<const std::uint64_t> ticks,
                                          std::uint32_t valid_bits, double period_ns) {
  const std::uint64_t mask =
      valid_bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << valid_bits) - 1;
  std::vector<double> times(ticks.size());
  std::uint64_t elapsed = 0;
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    elapsed += (ticks[i] - ticks[i - 1]) & mask;
    times[i] = static_cast<double>(elapsed) * period_ns * 1e-6;
  }
  return times;
}

}  // namespace probelab
