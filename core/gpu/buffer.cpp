// SPDX-License-Identifier: Apache-2.0
// Buffers with a memory allocation each. Which memory: see memoryScore.
#include "gpu/buffer.h"

#include <algorithm>
#include <cstring>
#include <optional>

#include "vulkan_state.h"

namespace probelab {
namespace {

constexpr VkMemoryPropertyFlags kMappable = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
                                            VK_MEMORY_PROPERTY_HOST_COHERENT_BIT |
                                            VK_MEMORY_PROPERTY_HOST_CACHED_BIT;

// Whether the host may reach device memory of this kind directly: on devices that share the host's
// memory, where a copy through the staging buffer would only cost.
bool isSharedMemory(const VulkanState& state, VkMemoryPropertyFlags flags) {
  const std::string& type = state.physical.info.type;
  return !state.act_discrete && type != "discrete GPU" && (flags & kMappable) == kMappable;
}

// 0: unusable. Higher is better; equal ones keep the driver's order, which is by performance.
int memoryScore(const VulkanState& state, VkMemoryPropertyFlags flags, MemoryUse use) {
  constexpr VkMemoryPropertyFlags special =
      VK_MEMORY_PROPERTY_LAZILY_ALLOCATED_BIT | VK_MEMORY_PROPERTY_PROTECTED_BIT |
      VK_MEMORY_PROPERTY_DEVICE_COHERENT_BIT_AMD | VK_MEMORY_PROPERTY_DEVICE_UNCACHED_BIT_AMD;
  if (flags & special) return 0;
  const bool local = flags & VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
  const bool visible = flags & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT;
  if (use == MemoryUse::device)
    return 1 + 4 * local + 2 * isSharedMemory(state, flags) + 1 * !visible;
  if (!visible) return 0;
  // Uncached memory is read at a tenth of the speed; a flush costs little beside that.
  return 1 + 4 * bool(flags & VK_MEMORY_PROPERTY_HOST_CACHED_BIT) +
         2 * bool(flags & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT) + 1 * !local;
}

}  // namespace

std::uint32_t chooseMemoryType(const VulkanState& state, std::uint32_t allowed, MemoryUse use,
                               const std::string& label) {
  std::optional<std::uint32_t> best;
  int best_score = 0;
  for (std::uint32_t i = 0; i < state.memory.memoryTypeCount; ++i) {
    if (!(allowed & (1u << i))) continue;
    const int score = memoryScore(state, state.memory.memoryTypes[i].propertyFlags, use);
    if (score > best_score) best = i, best_score = score;
  }
  if (!best) throw DeviceError(fmt::format("{}: the device has no memory for it", label));
  return *best;
}

namespace {

void createVkBuffer(BufferState& buffer, VkBufferUsageFlags usage, const std::string& label) {
  const VkDevice device = buffer.vulkan->device;
  VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
  info.size = buffer.allocated;
  info.usage = usage;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  VkBuffer handle = VK_NULL_HANDLE;
  checkVulkan(vkCreateBuffer(device, &info, nullptr, &handle), "vkCreateBuffer", label);
  buffer.buffer = {device, handle, vkDestroyBuffer};
  setName(*buffer.vulkan, VK_OBJECT_TYPE_BUFFER, handle, buffer.name);
}

// Allocates, binds and, where the host may access the memory, maps it.
void allocateMemory(BufferState& buffer, const std::string& label) {
  VulkanState& state = *buffer.vulkan;
  VkMemoryRequirements needs{};
  vkGetBufferMemoryRequirements(state.device, buffer.buffer.get(), &needs);
  VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO};
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
  info.pNext = &flags;
  info.allocationSize = needs.size;
  info.memoryTypeIndex = chooseMemoryType(state, needs.memoryTypeBits, buffer.use, label);
  VkDeviceMemory memory = VK_NULL_HANDLE;
  checkVulkan(vkAllocateMemory(state.device, &info, nullptr, &memory), "vkAllocateMemory", label);
  buffer.memory = {state.device, memory, vkFreeMemory};
  setName(state, VK_OBJECT_TYPE_DEVICE_MEMORY, memory, buffer.name);
  checkVulkan(vkBindBufferMemory(state.device, buffer.buffer.get(), memory, 0),
              "vkBindBufferMemory", label);

  const VkMemoryPropertyFlags type = state.memory.memoryTypes[info.memoryTypeIndex].propertyFlags;
  if (buffer.use == MemoryUse::device && !isSharedMemory(state, type)) return;
  void* mapped = nullptr;
  checkVulkan(vkMapMemory(state.device, memory, 0, VK_WHOLE_SIZE, 0, &mapped), "vkMapMemory",
              label);
  buffer.mapped = static_cast<std::byte*>(mapped);
  buffer.non_coherent = state.act_discrete || !(type & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
  if (buffer.non_coherent) state.non_coherent.push_back(memory);
}

std::string sizeLabel(const std::string& name, std::size_t bytes) {
  return fmt::format("buffer '{}' of {} bytes ({:.1f} MiB)", name, bytes,
                     static_cast<double>(bytes) / (1 << 20));
}

}  // namespace

BufferState::~BufferState() {
  if (!non_coherent) return;
  std::erase(vulkan->non_coherent, memory.get());
}

GpuBuffer::GpuBuffer() = default;
GpuBuffer::GpuBuffer(std::unique_ptr<BufferState> state) : state_(std::move(state)) {}
GpuBuffer::GpuBuffer(GpuBuffer&&) noexcept = default;
GpuBuffer& GpuBuffer::operator=(GpuBuffer&&) noexcept = default;
GpuBuffer::~GpuBuffer() = default;

std::size_t GpuBuffer::size() const { return state_->bytes; }
const std::string& GpuBuffer::name() const { return state_->name; }
std::uint64_t GpuBuffer::address() const { return state_->address; }
std::byte* GpuBuffer::mapped() const {
  return state_->use == MemoryUse::host_visible ? state_->mapped : nullptr;
}

GpuBuffer createRawBuffer(VulkanState& state, std::size_t bytes, MemoryUse use,
                          VkBufferUsageFlags usage, std::string name) {
  auto buffer = std::make_unique<BufferState>();
  buffer->vulkan = &state;
  buffer->name = std::move(name);
  buffer->use = use;
  buffer->bytes = bytes;
  // Vulkan has no buffers of 0 bytes; fills and ranges count in words of 4.
  buffer->allocated = std::max<std::size_t>(16, (bytes + 3) / 4 * 4);
  const std::string label = sizeLabel(buffer->name, bytes);
  const std::uint64_t limit = state.physical.info.max_buffer_size;
  if (buffer->allocated > limit)
    throw DeviceError(
        fmt::format("{}: the device allows {} bytes in one allocation", label, limit));
  createVkBuffer(*buffer, usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT, label);
  allocateMemory(*buffer, label);
  VkBufferDeviceAddressInfo address{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO};
  address.buffer = buffer->buffer.get();
  buffer->address = vkGetBufferDeviceAddress(state.device, &address);
  return GpuBuffer(std::move(buffer));
}

GpuBuffer createBuffer(GpuContext& context, std::size_t bytes, MemoryUse use, std::string name) {
  VulkanState& state = context.state();
  const std::uint64_t limit = context.info().max_storage_buffer_range;
  if (bytes > limit)
    throw DeviceError(fmt::format(
        "{}: the device allows {} bytes in one storage buffer (maxStorageBufferRange); use smaller "
        "batches",
        sizeLabel(name, bytes), limit));
  VkBufferUsageFlags usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                             VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                             VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  if (context.info().ray_query)
    usage |= VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
  GpuBuffer buffer = createRawBuffer(state, bytes, use, usage, std::move(name));
  const BufferState& raw = buffer.state();
  if (raw.mapped != nullptr) {
    std::memset(raw.mapped, 0, raw.allocated);
  } else {
    beginCommands(state, state.transfer);
    vkCmdFillBuffer(state.transfer.commands, raw.buffer.get(), 0, raw.allocated, 0);
    submitCommands(state, state.transfer);
  }
  return buffer;
}

}  // namespace probelab
