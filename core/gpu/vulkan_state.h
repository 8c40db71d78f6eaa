// SPDX-License-Identifier: Apache-2.0
// What the parts of core/gpu share: the Vulkan objects behind the public types, checked calls and
// owning handles. Not exported; the only header that includes Vulkan.
#pragma once

#include <vulkan/vulkan.h>

#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "gpu/buffer.h"
#include "gpu/context.h"
#include "gpu/image.h"

namespace probelab {

// "VK_ERROR_DEVICE_LOST (the device was reset ...)".
std::string describeResult(VkResult result);

// The error of a machine without any device or driver.
[[noreturn]] void throwNoDevice();

// Throws DeviceError "{call}: {result}{what}" unless the result is VK_SUCCESS.
void checkVulkan(VkResult result, std::string_view call, std::string_view what = {});

// Owns a device-level object.
template <class T>
class Handle {
 public:
  using Destroy = void (*)(VkDevice, T, const VkAllocationCallbacks*);
  Handle() = default;
  Handle(VkDevice device, T handle, Destroy destroy)
      : device_(device), handle_(handle), destroy_(destroy) {}
  Handle(Handle&& other) noexcept { swap(other); }
  Handle& operator=(Handle&& other) noexcept {
    Handle(std::move(other)).swap(*this);
    return *this;
  }
  ~Handle() {
    if (handle_ != VK_NULL_HANDLE) destroy_(device_, handle_, nullptr);
  }
  T get() const { return handle_; }
  const T* pointer() const { return &handle_; }
  explicit operator bool() const { return handle_ != VK_NULL_HANDLE; }

 private:
  void swap(Handle& other) noexcept {
    std::swap(device_, other.device_);
    std::swap(handle_, other.handle_);
    std::swap(destroy_, other.destroy_);
  }
  VkDevice device_ = VK_NULL_HANDLE;
  T handle_ = VK_NULL_HANDLE;
  Destroy destroy_ = nullptr;
};

// Functions that the loader does not export.
struct DeviceFunctions {
  PFN_vkSetDebugUtilsObjectNameEXT set_name = nullptr;
  PFN_vkCreateAccelerationStructureKHR create_acceleration_structure = nullptr;
  PFN_vkDestroyAccelerationStructureKHR destroy_acceleration_structure = nullptr;
  PFN_vkGetAccelerationStructureBuildSizesKHR acceleration_structure_sizes = nullptr;
  PFN_vkCmdBuildAccelerationStructuresKHR build_acceleration_structures = nullptr;
  PFN_vkGetAccelerationStructureDeviceAddressKHR acceleration_structure_address = nullptr;
};

struct ValidationLog {
  mutable std::mutex mutex;
  std::vector<std::string> messages;
  bool print = false;
};

// An instance with its validation messenger.
struct InstanceState {
  InstanceState() = default;
  InstanceState(const InstanceState&) = delete;
  InstanceState& operator=(const InstanceState&) = delete;
  ~InstanceState();
  VkInstance instance = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger = VK_NULL_HANDLE;
  bool debug_utils = false;
  ValidationLog log;
};
void createInstance(InstanceState& state, bool validation, bool print);

struct PhysicalDevice {
  VkPhysicalDevice handle = VK_NULL_HANDLE;
  std::uint32_t queue_family = 0;
  VkPhysicalDeviceAccelerationStructurePropertiesKHR acceleration{};
  DeviceInfo info;
};
std::vector<PhysicalDevice> physicalDevices(VkInstance instance);

// A resettable command buffer with its pool and the fence of its submission.
struct CommandBuffer {
  Handle<VkCommandPool> pool;
  VkCommandBuffer commands = VK_NULL_HANDLE;
  Handle<VkFence> fence;
};

struct VulkanState {
  VulkanState() = default;
  VulkanState(const VulkanState&) = delete;
  VulkanState& operator=(const VulkanState&) = delete;
  ~VulkanState();

  InstanceState instance;
  PhysicalDevice physical;
  VkPhysicalDeviceMemoryProperties memory{};
  VkDevice device = VK_NULL_HANDLE;
  VkQueue queue = VK_NULL_HANDLE;
  DeviceFunctions functions;
  bool act_discrete = false;
  // Mapped memory that must be flushed before and invalidated after each submission.
  std::vector<VkDeviceMemory> non_coherent;
  // With this, uploads, downloads, zeroing and builds run; the staging buffer appears with the
  // first transfer that needs it.
  CommandBuffer transfer;
  GpuBuffer staging;
  // Compiled so far, by name, defines and text: every field of a context needs the same few.
  std::map<std::string, std::vector<std::uint32_t>> shaders;
};

template <class T>
void setName(const VulkanState& state, VkObjectType type, T handle, const std::string& name) {
  if (!state.functions.set_name) return;
  VkDebugUtilsObjectNameInfoEXT info{VK_STRUCTURE_TYPE_DEBUG_UTILS_OBJECT_NAME_INFO_EXT};
  info.objectType = type;
  info.objectHandle = (std::uint64_t)handle;
  info.pObjectName = name.c_str();
  state.functions.set_name(state.device, &info);
}

struct BufferState {
  BufferState() = default;
  BufferState(const BufferState&) = delete;
  BufferState& operator=(const BufferState&) = delete;
  ~BufferState();
  VulkanState* vulkan = nullptr;
  std::string name;
  std::size_t bytes = 0;      // as asked for
  std::size_t allocated = 0;  // of the VkBuffer: a multiple of 4, at least 16
  MemoryUse use = MemoryUse::device;
  Handle<VkBuffer> buffer;
  Handle<VkDeviceMemory> memory;
  std::byte* mapped = nullptr;  // also for device memory that happens to be host-visible
  bool non_coherent = false;
  std::uint64_t address = 0;
};

// The best kind of memory for `use` among the `allowed` types (bits); DeviceError "{label}: ..."
// when there is none.
std::uint32_t chooseMemoryType(const VulkanState& state, std::uint32_t allowed, MemoryUse use,
                               const std::string& label);

// A buffer that no shader binds, so that maxStorageBufferRange does not bound it; contents
// undefined.
GpuBuffer createRawBuffer(VulkanState& state, std::size_t bytes, MemoryUse use,
                          VkBufferUsageFlags usage, std::string name);

struct ImageState {
  VulkanState* vulkan = nullptr;
  std::string name;
  ImageFormat format{};
  ImageSize size;
  // As recorded last: commands run in the order in which they are recorded.
  VkImageLayout layout = VK_IMAGE_LAYOUT_UNDEFINED;
  Handle<VkDeviceMemory> memory;  // after this the image, so that it dies first
  Handle<VkImage> image;
  Handle<VkImageView> view;
  Handle<VkSampler> sampler;
};

CommandBuffer createCommandBuffer(const VulkanState& state, const std::string& name);
// Begins with everything submitted before visible to the commands.
void beginCommands(const VulkanState& state, const CommandBuffer& commands);
// All commands before happen before, and are visible to, all commands after; and to the host once
// the submission's fence is signalled.
void recordBarrier(const CommandBuffer& commands);
// The same with a change of the image's layout; what it holds is kept unless it was undefined.
void recordLayout(const CommandBuffer& commands, ImageState& image, VkImageLayout layout);
VkImageLayout layoutOf(ImageUse use);
void recordClear(const CommandBuffer& commands, const ImageState& image);
// Ends, flushes mapped memory, submits, waits, invalidates mapped memory.
void submitCommands(const VulkanState& state, const CommandBuffer& commands);

}  // namespace probelab
