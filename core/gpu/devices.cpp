// SPDX-License-Identifier: Apache-2.0
// What devices there are, what they can do, and which one is meant.
#include <algorithm>
#include <cctype>
#include <cstring>

#include "vulkan_state.h"

namespace probelab {
namespace {

const char* typeName(VkPhysicalDeviceType type) {
  switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
      return "discrete GPU";
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
      return "integrated GPU";
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
      return "virtual GPU";
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
      return "CPU";
    default:
      return "other";
  }
}

int typeRank(const std::string& type) {
  const char* order[] = {"discrete GPU", "integrated GPU", "virtual GPU", "CPU"};
  return static_cast<int>(std::find(std::begin(order), std::end(order), type) - order);
}

bool hasExtensions(VkPhysicalDevice device, std::initializer_list<const char*> names) {
  std::uint32_t count = 0;
  vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr);
  std::vector<VkExtensionProperties> extensions(count);
  vkEnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data());
  return std::all_of(names.begin(), names.end(), [&](const char* name) {
    return std::any_of(extensions.begin(), extensions.end(), [&](const VkExtensionProperties& e) {
      return std::strcmp(e.extensionName, name) == 0;
    });
  });
}

std::string versionText(std::uint32_t version) {
  return fmt::format("{}.{}.{}", VK_API_VERSION_MAJOR(version), VK_API_VERSION_MINOR(version),
                     VK_API_VERSION_PATCH(version));
}

void fillLimits(DeviceInfo& info, const VkPhysicalDeviceLimits& limits) {
  info.max_storage_buffer_range = limits.maxStorageBufferRange;
  info.max_workgroup_invocations = limits.maxComputeWorkGroupInvocations;
  for (std::size_t i = 0; i < 3; ++i) {
    info.max_workgroup_size[i] = limits.maxComputeWorkGroupSize[i];
    info.max_workgroup_count[i] = limits.maxComputeWorkGroupCount[i];
  }
  info.max_shared_memory_bytes = limits.maxComputeSharedMemorySize;
  info.max_push_constant_bytes = limits.maxPushConstantsSize;
  info.max_storage_buffers_per_stage =
      std::min(limits.maxPerStageDescriptorStorageBuffers, limits.maxPerStageResources);
  info.max_storage_images_per_stage =
      std::min(limits.maxPerStageDescriptorStorageImages, limits.maxPerStageResources);
  info.max_sampled_images_per_stage =
      std::min({limits.maxPerStageDescriptorSampledImages, limits.maxPerStageDescriptorSamplers,
                limits.maxPerStageResources});
  info.max_image_side = limits.maxImageDimension2D;
  info.max_image_layers = limits.maxImageArrayLayers;
  info.timestamp_period_ns = limits.timestampPeriod;
}

// Properties of Vulkan 1.3 and of the acceleration structures.
void queryProperties(PhysicalDevice& device, bool with_acceleration) {
  VkPhysicalDeviceProperties2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2};
  VkPhysicalDeviceVulkan11Properties v11{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES};
  VkPhysicalDeviceVulkan12Properties v12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES};
  VkPhysicalDeviceVulkan13Properties v13{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES};
  device.acceleration = {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR};
  all.pNext = &v11;
  v11.pNext = &v12;
  v12.pNext = &v13;
  v13.pNext = with_acceleration ? &device.acceleration : nullptr;
  vkGetPhysicalDeviceProperties2(device.handle, &all);
  device.acceleration.pNext = nullptr;
  device.info.driver = fmt::format("{} {}", v12.driverName, v12.driverInfo);
  device.info.subgroup_size = v11.subgroupSize;
  device.info.max_buffer_size =
      std::min<std::uint64_t>(v13.maxBufferSize, v11.maxMemoryAllocationSize);
}

void queryFeatures(PhysicalDevice& device, bool with_ray_query) {
  VkPhysicalDeviceFeatures2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2};
  VkPhysicalDeviceVulkan12Features v12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
  VkPhysicalDeviceVulkan13Features v13{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES};
  VkPhysicalDeviceAccelerationStructureFeaturesKHR acceleration{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR};
  VkPhysicalDeviceRayQueryFeaturesKHR ray_query{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR};
  all.pNext = &v12;
  v12.pNext = &v13;
  v13.pNext = with_ray_query ? &acceleration : nullptr;
  acceleration.pNext = &ray_query;
  vkGetPhysicalDeviceFeatures2(device.handle, &all);
  device.info.two_channel_storage_images = all.features.shaderStorageImageExtendedFormats;
  std::vector<std::string>& missing = device.info.missing;
  if (!v12.bufferDeviceAddress) missing.emplace_back("bufferDeviceAddress");
  if (!v12.scalarBlockLayout) missing.emplace_back("scalarBlockLayout");
  if (!v13.synchronization2) missing.emplace_back("synchronization2");
  if (!v13.maintenance4) missing.emplace_back("maintenance4");
  device.info.ray_query =
      with_ray_query && acceleration.accelerationStructure && ray_query.rayQuery;
}

// The first family with compute and timestamps.
void queryQueues(PhysicalDevice& device) {
  std::uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(device.handle, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(device.handle, &count, families.data());
  for (std::uint32_t i = 0; i < count; ++i)
    if ((families[i].queueFlags & VK_QUEUE_COMPUTE_BIT) && families[i].timestampValidBits > 0) {
      device.queue_family = i;
      device.info.timestamp_valid_bits = families[i].timestampValidBits;
      return;
    }
  device.info.missing.emplace_back("a compute queue with timestamps");
}

void queryMemory(PhysicalDevice& device) {
  VkPhysicalDeviceMemoryProperties memory{};
  vkGetPhysicalDeviceMemoryProperties(device.handle, &memory);
  for (std::uint32_t i = 0; i < memory.memoryHeapCount; ++i)
    if (memory.memoryHeaps[i].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT)
      device.info.device_local_bytes =
          std::max<std::uint64_t>(device.info.device_local_bytes, memory.memoryHeaps[i].size);
}

PhysicalDevice describeDevice(VkPhysicalDevice handle) {
  PhysicalDevice device;
  device.handle = handle;
  VkPhysicalDeviceProperties properties{};
  vkGetPhysicalDeviceProperties(handle, &properties);
  DeviceInfo& info = device.info;
  info.name = properties.deviceName;
  info.api_version = versionText(properties.apiVersion);
  info.type = typeName(properties.deviceType);
  info.is_cpu = properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
  fillLimits(info, properties.limits);
  queryQueues(device);
  queryMemory(device);
  if (properties.apiVersion < VK_API_VERSION_1_3) {
    info.missing.emplace_back("Vulkan 1.3");
    return device;
  }
  const bool acceleration = hasExtensions(handle, {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                                   VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME});
  queryProperties(device, acceleration);
  queryFeatures(device, acceleration && hasExtensions(handle, {VK_KHR_RAY_QUERY_EXTENSION_NAME}));
  return device;
}

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

std::string listText(std::span<const DeviceInfo> devices) {
  std::string text;
  for (std::size_t i = 0; i < devices.size(); ++i)
    text += fmt::format("{}{}: {} ({})", i == 0 ? "" : ", ", i, devices[i].name, devices[i].type);
  return text;
}

void requireSuitable(const DeviceInfo& device) {
  if (device.missing.empty()) return;
  throw DeviceError(
      fmt::format("Vulkan device '{}' lacks {}", device.name, fmt::join(device.missing, ", ")));
}

std::size_t bestDevice(std::span<const DeviceInfo> devices) {
  std::size_t best = devices.size();
  for (std::size_t i = 0; i < devices.size(); ++i) {
    if (!devices[i].missing.empty()) continue;
    if (best == devices.size() || typeRank(devices[i].type) < typeRank(devices[best].type))
      best = i;
  }
  if (best == devices.size()) requireSuitable(devices[0]);
  return best;
}

// The index that `wanted` spells; devices.size() when it is not one.
std::size_t indexOf(std::span<const DeviceInfo> devices, const std::string& wanted) {
  for (std::size_t i = 0; i < devices.size(); ++i)
    if (wanted == std::to_string(i)) return i;
  return devices.size();
}

}  // namespace

std::vector<PhysicalDevice> physicalDevices(VkInstance instance) {
  std::uint32_t count = 0;
  checkVulkan(vkEnumeratePhysicalDevices(instance, &count, nullptr), "vkEnumeratePhysicalDevices");
  std::vector<VkPhysicalDevice> handles(count);
  const VkResult result = vkEnumeratePhysicalDevices(instance, &count, handles.data());
  if (result != VK_INCOMPLETE) checkVulkan(result, "vkEnumeratePhysicalDevices");
  handles.resize(count);
  std::vector<PhysicalDevice> devices;
  for (const VkPhysicalDevice handle : handles) devices.push_back(describeDevice(handle));
  return devices;
}

std::vector<DeviceInfo> listDevices() {
  std::vector<DeviceInfo> infos;
  try {
    InstanceState state;
    createInstance(state, false, false);
    for (PhysicalDevice& device : physicalDevices(state.instance))
      infos.push_back(std::move(device.info));
  } catch (const DeviceError&) {
    return {};  // no driver: an expected answer here, an error in GpuContext
  }
  return infos;
}

void throwNoDevice() {
  throw DeviceError(
      "there is no Vulkan device; install a driver (a GPU's own, or Mesa's lavapipe, "
      "Debian: mesa-vulkan-drivers)");
}

std::size_t chooseDevice(std::span<const DeviceInfo> devices, const std::string& wanted) {
  if (devices.empty()) throwNoDevice();
  if (wanted.empty()) return bestDevice(devices);
  std::size_t found = indexOf(devices, wanted);
  // One or two digits are an index and nothing else; more are a model, as in "4090".
  const bool number =
      wanted.size() <= 2 &&
      std::ranges::all_of(wanted, [](unsigned char c) { return std::isdigit(c) != 0; });
  if (found == devices.size() && !number) {
    for (std::size_t i = 0; i < devices.size(); ++i) {
      if (lower(devices[i].name).find(lower(wanted)) == std::string::npos) continue;
      if (found != devices.size())
        throw DeviceError(fmt::format("several Vulkan devices match '{}', give an index: {}",
                                      wanted, listText(devices)));
      found = i;
    }
  }
  if (found == devices.size())
    throw DeviceError(fmt::format("no Vulkan device matches '{}'; by index there is {}", wanted,
                                  listText(devices)));
  requireSuitable(devices[found]);
  return found;
}

}  // namespace probelab
