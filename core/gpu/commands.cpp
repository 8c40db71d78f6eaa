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
constexpr std::uint32_t kImagesPerPool = 128;  // of each kind

VkDescriptorPool addPool(CommandsState& state, const PipelineOptions& needs) {
  std::vector<VkDescriptorPoolSize> sizes{
      {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, std::max(needs.buffer_count, kBuffersPerPool)},
      {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, std::max(needs.buffer_count, kBuffersPerPool)},
      {VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, std::max(needs.storage_image_count, kImagesPerPool)},
      {VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER,
       std::max(needs.sampled_image_count, kImagesPerPool)}};
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
  info.descriptorPool = addPool(state, pipeline.options);
  checkVulkan(vkAllocateDescriptorSets(state.vulkan->device, &info, &set),
              "vkAllocateDescriptorSets", pipeline.name);
  return set;
}

// Writes a set, binding by binding.
class SetWriter {
 public:
  SetWriter(const VulkanState& state, const PipelineOptions& options, VkDescriptorSet set)
      : state_(state), options_(options), set_(set) {}

  void write(const Bindings& bindings) {
    // The writes point into these, which must not move.
    buffers_.reserve(bindings.buffers.size());
    images_.reserve(bindings.storage_images.size() + bindings.sampled_images.size());
    for (const GpuBuffer* buffer : bindings.buffers) addBuffer(buffer);
    if (bindings.acceleration_structure != nullptr)
      addAccelerationStructure(*bindings.acceleration_structure);
    for (const GpuImage* image : bindings.storage_images) addImage(*image, ImageUse::storage);
    for (const GpuImage* image : bindings.sampled_images) addImage(*image, ImageUse::sampled);
    vkUpdateDescriptorSets(state_.device, static_cast<std::uint32_t>(writes_.size()),
                           writes_.data(), 0, nullptr);
  }

 private:
  void addBuffer(const GpuBuffer* buffer) {
    const std::uint32_t binding = next_++;
    if (buffer == nullptr) return;
    const VkDeviceSize max_range = state_.physical.info.max_storage_buffer_range;
    const BufferState& b = buffer->state();
    const bool uniform = isUniformBuffer(options_, binding);
    buffers_.push_back({b.buffer.get(), 0, std::min<VkDeviceSize>(b.allocated, max_range)});
    add(binding, uniform ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER)
        .pBufferInfo = &buffers_.back();
  }
  void addAccelerationStructure(const AccelerationStructure& as) {
    as_info_.accelerationStructureCount = 1;
    as_info_.pAccelerationStructures = as.state().top.pointer();
    add(next_++, VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR).pNext = &as_info_;
  }
  void addImage(const GpuImage& image, ImageUse use) {
    const ImageState& i = image.state();
    PROBELAB_CHECK(i.layout == layoutOf(use));  // Commands::setUse
    const bool sampled = use == ImageUse::sampled;
    images_.push_back({sampled ? i.sampler.get() : VK_NULL_HANDLE, i.view.get(), i.layout});
    add(next_++,
        sampled ? VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER : VK_DESCRIPTOR_TYPE_STORAGE_IMAGE)
        .pImageInfo = &images_.back();
  }
  VkWriteDescriptorSet& add(std::uint32_t binding, VkDescriptorType type) {
    VkWriteDescriptorSet& write = writes_.emplace_back();
    write = {VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
    write.dstSet = set_;
    write.descriptorCount = 1;
    write.dstBinding = binding;
    write.descriptorType = type;
    return write;
  }

  const VulkanState& state_;
  const PipelineOptions& options_;
  VkDescriptorSet set_;
  std::uint32_t next_ = 0;
  std::vector<VkDescriptorBufferInfo> buffers_;
  std::vector<VkDescriptorImageInfo> images_;
  VkWriteDescriptorSetAccelerationStructureKHR as_info_{
      VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR};
  std::vector<VkWriteDescriptorSet> writes_;
};

// The number of bindings; they must be those of the pipeline.
std::size_t checkBindings(const PipelineOptions& options, const Bindings& bindings) {
  const bool has_as = bindings.acceleration_structure != nullptr;
  PROBELAB_CHECK_EQ(bindings.buffers.size(), options.buffer_count);
  PROBELAB_CHECK_EQ(has_as, options.acceleration_structure);
  PROBELAB_CHECK_EQ(bindings.storage_images.size(), options.storage_image_count);
  PROBELAB_CHECK_EQ(bindings.sampled_images.size(), options.sampled_image_count);
  return bindings.buffers.size() + has_as + bindings.storage_images.size() +
         bindings.sampled_images.size();
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
  dispatch(pipeline, Bindings{{buffers.begin(), buffers.end()}, as, {}, {}}, push, groups_x,
           groups_y, groups_z);
}

void Commands::dispatch(const ComputePipeline& pipeline, const Bindings& bindings,
                        std::span<const std::byte> push, std::uint32_t groups_x,
                        std::uint32_t groups_y, std::uint32_t groups_z) {
  CommandsState& s = *state_;
  const PipelineState& p = pipeline.state();
  PROBELAB_CHECK(s.recording);
  const std::size_t binding_count = checkBindings(p.options, bindings);
  PROBELAB_CHECK_EQ(push.size(), p.options.push_constant_bytes);
  checkGroups(s.vulkan->physical.info, p.name, {groups_x, groups_y, groups_z});
  if (groups_x == 0 || groups_y == 0 || groups_z == 0) return;
  const VkCommandBuffer commands = s.commands.commands;
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, p.pipeline.get());
  if (binding_count > 0) {
    const VkDescriptorSet set = allocateSet(s, p);
    SetWriter(*s.vulkan, pipeline.options(), set).write(bindings);
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

void Commands::setUse(GpuImage& image, ImageUse use) {
  PROBELAB_CHECK(state_->recording);
  recordLayout(state_->commands, image.state(), layoutOf(use));
}

void Commands::clear(GpuImage& image) {
  PROBELAB_CHECK(state_->recording);
  PROBELAB_CHECK(image.state().layout == layoutOf(ImageUse::storage));
  recordClear(state_->commands, image.state());
}

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
