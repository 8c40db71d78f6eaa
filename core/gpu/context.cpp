// SPDX-License-Identifier: Apache-2.0
#include "gpu/context.h"

#include "vulkan_state.h"

namespace probelab {
namespace {

void selectDevice(VulkanState& state, const std::string& wanted) {
  std::vector<PhysicalDevice> devices = physicalDevices(state.instance.instance);
  std::vector<DeviceInfo> infos;
  for (const PhysicalDevice& device : devices) infos.push_back(device.info);
  state.physical = std::move(devices[chooseDevice(infos, wanted)]);
  vkGetPhysicalDeviceMemoryProperties(state.physical.handle, &state.memory);
}

void createDevice(VulkanState& state) {
  const float priority = 1;
  VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO};
  queue.queueFamilyIndex = state.physical.queue_family;
  queue.queueCount = 1;
  queue.pQueuePriorities = &priority;

  VkPhysicalDeviceVulkan12Features v12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
  v12.bufferDeviceAddress = VK_TRUE;
  v12.scalarBlockLayout = VK_TRUE;
  VkPhysicalDeviceVulkan13Features v13{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES};
  v13.synchronization2 = VK_TRUE;
  v13.maintenance4 = VK_TRUE;
  VkPhysicalDeviceAccelerationStructureFeaturesKHR acceleration{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR};
  acceleration.accelerationStructure = VK_TRUE;
  VkPhysicalDeviceRayQueryFeaturesKHR ray_query{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR};
  ray_query.rayQuery = VK_TRUE;
  v12.pNext = &v13;
  std::vector<const char*> extensions;
  if (state.physical.info.ray_query) {
    extensions = {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                  VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME, VK_KHR_RAY_QUERY_EXTENSION_NAME};
    v13.pNext = &acceleration;
    acceleration.pNext = &ray_query;
  }

  VkDeviceCreateInfo info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO};
  VkPhysicalDeviceFeatures features{};
  features.shaderStorageImageExtendedFormats = state.physical.info.two_channel_storage_images;
  info.pNext = &v12;
  info.pEnabledFeatures = &features;
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queue;
  info.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();
  checkVulkan(vkCreateDevice(state.physical.handle, &info, nullptr, &state.device),
              "vkCreateDevice", "'" + state.physical.info.name + "'");
  vkGetDeviceQueue(state.device, state.physical.queue_family, 0, &state.queue);
}

template <class Function>
void loadFunction(const VulkanState& state, Function& function, const char* name) {
  function = reinterpret_cast<Function>(vkGetDeviceProcAddr(state.device, name));
  if (function == nullptr) throw DeviceError(fmt::format("the Vulkan driver lacks {}", name));
}

void loadFunctions(VulkanState& state) {
  DeviceFunctions& f = state.functions;
  if (state.instance.debug_utils)
    f.set_name = reinterpret_cast<PFN_vkSetDebugUtilsObjectNameEXT>(
        vkGetInstanceProcAddr(state.instance.instance, "vkSetDebugUtilsObjectNameEXT"));
  if (!state.physical.info.ray_query) return;
  loadFunction(state, f.create_acceleration_structure, "vkCreateAccelerationStructureKHR");
  loadFunction(state, f.destroy_acceleration_structure, "vkDestroyAccelerationStructureKHR");
  loadFunction(state, f.acceleration_structure_sizes, "vkGetAccelerationStructureBuildSizesKHR");
  loadFunction(state, f.build_acceleration_structures, "vkCmdBuildAccelerationStructuresKHR");
  loadFunction(state, f.acceleration_structure_address,
               "vkGetAccelerationStructureDeviceAddressKHR");
}

}  // namespace

VulkanState::~VulkanState() {
  if (device == VK_NULL_HANDLE) return;
  vkDeviceWaitIdle(device);
  staging = {};
  transfer = {};
  vkDestroyDevice(device, nullptr);
}

GpuContext::GpuContext(const DeviceOptions& options) : state_(std::make_unique<VulkanState>()) {
  createInstance(state_->instance, options.validation, options.print_validation);
  selectDevice(*state_, options.device);
  state_->physical.info.ray_query = state_->physical.info.ray_query && options.ray_query;
  state_->act_discrete = options.act_discrete;
  createDevice(*state_);
  loadFunctions(*state_);
  setName(*state_, VK_OBJECT_TYPE_QUEUE, state_->queue, "compute");
  state_->transfer = createCommandBuffer(*state_, "transfers");
}

GpuContext::GpuContext(GpuContext&&) noexcept = default;
GpuContext& GpuContext::operator=(GpuContext&&) noexcept = default;
GpuContext::~GpuContext() = default;

const DeviceInfo& GpuContext::info() const { return state_->physical.info; }

std::span<const std::string> GpuContext::validationMessages() const {
  return state_->instance.log.messages;
}

}  // namespace probelab
