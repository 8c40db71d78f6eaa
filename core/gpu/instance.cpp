// SPDX-License-Identifier: Apache-2.0
// The Vulkan instance with the optional validation layer.
#include <algorithm>
#include <cstring>

#include "vulkan_state.h"

namespace probelab {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

VKAPI_ATTR VkBool32 VKAPI_CALL collectMessage(VkDebugUtilsMessageSeverityFlagBitsEXT,
                                              VkDebugUtilsMessageTypeFlagsEXT,
                                              const VkDebugUtilsMessengerCallbackDataEXT* data,
                                              void* user) {
  auto& log = *static_cast<ValidationLog*>(user);
  const std::lock_guard lock(log.mutex);
  log.messages.emplace_back(data->pMessage != nullptr ? data->pMessage : "(no text)");
  if (log.print) printToStderr(fmt::format("Vulkan validation: {}\n", log.messages.back()));
  return VK_FALSE;
}

VkDebugUtilsMessengerCreateInfoEXT messengerInfo(ValidationLog& log) {
  VkDebugUtilsMessengerCreateInfoEXT info{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
  info.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT |
                         VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  // Not GENERAL: those are the loader's remarks on the machine's set-up.
  info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT |
                     VK_DEBUG_UTILS_MESSAGE_TYPE_PERFORMANCE_BIT_EXT;
  info.pfnUserCallback = collectMessage;
  info.pUserData = &log;
  return info;
}

bool hasLayer(const char* name) {
  std::uint32_t count = 0;
  vkEnumerateInstanceLayerProperties(&count, nullptr);
  std::vector<VkLayerProperties> layers(count);
  vkEnumerateInstanceLayerProperties(&count, layers.data());
  return std::any_of(layers.begin(), layers.end(), [&](const VkLayerProperties& layer) {
    return std::strcmp(layer.layerName, name) == 0;
  });
}

// `layer`: null for the loader's and drivers' extensions.
bool hasInstanceExtension(const char* layer, const char* name) {
  std::uint32_t count = 0;
  vkEnumerateInstanceExtensionProperties(layer, &count, nullptr);
  std::vector<VkExtensionProperties> extensions(count);
  vkEnumerateInstanceExtensionProperties(layer, &count, extensions.data());
  return std::any_of(extensions.begin(), extensions.end(), [&](const VkExtensionProperties& e) {
    return std::strcmp(e.extensionName, name) == 0;
  });
}

void requireLoader() {
  std::uint32_t version = 0;
  checkVulkan(vkEnumerateInstanceVersion(&version), "vkEnumerateInstanceVersion");
  if (version < VK_API_VERSION_1_3)
    throw DeviceError(fmt::format("the Vulkan loader is version {}.{}; 1.3 is needed",
                                  VK_API_VERSION_MAJOR(version), VK_API_VERSION_MINOR(version)));
}

void createMessenger(InstanceState& state, const VkDebugUtilsMessengerCreateInfoEXT& info) {
  const auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
      vkGetInstanceProcAddr(state.instance, "vkCreateDebugUtilsMessengerEXT"));
  if (create == nullptr) throw DeviceError("the validation layer lacks VK_EXT_debug_utils");
  checkVulkan(create(state.instance, &info, nullptr, &state.messenger),
              "vkCreateDebugUtilsMessengerEXT");
}

}  // namespace

InstanceState::~InstanceState() {
  if (messenger != VK_NULL_HANDLE)
    reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(vkGetInstanceProcAddr(
        instance, "vkDestroyDebugUtilsMessengerEXT"))(instance, messenger, nullptr);
  if (instance != VK_NULL_HANDLE) vkDestroyInstance(instance, nullptr);
}

void createInstance(InstanceState& state, bool validation, bool print) {
  requireLoader();
  if (validation && !hasLayer(kValidationLayer))
    throw DeviceError(
        fmt::format("validation was asked for, but {} is not installed (Debian: "
                    "vulkan-validationlayers)",
                    kValidationLayer));
  state.log.print = print;
  VkApplicationInfo application{VK_STRUCTURE_TYPE_APPLICATION_INFO};
  application.pApplicationName = "probelab";
  application.apiVersion = VK_API_VERSION_1_3;

  VkDebugUtilsMessengerCreateInfoEXT messenger = messengerInfo(state.log);
  const VkValidationFeatureEnableEXT synchronization =
      VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
  VkValidationFeaturesEXT features{VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT};
  features.pNext = &messenger;
  features.enabledValidationFeatureCount = 1;
  features.pEnabledValidationFeatures = &synchronization;

  std::vector<const char*> extensions;
  state.debug_utils =
      hasInstanceExtension(nullptr, VK_EXT_DEBUG_UTILS_EXTENSION_NAME) ||
      (validation && hasInstanceExtension(kValidationLayer, VK_EXT_DEBUG_UTILS_EXTENSION_NAME));
  if (state.debug_utils) extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
  if (validation) extensions.push_back(VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME);

  VkInstanceCreateInfo info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
  info.pNext = validation ? &features : nullptr;
  info.pApplicationInfo = &application;
  info.enabledLayerCount = validation ? 1 : 0;
  info.ppEnabledLayerNames = &kValidationLayer;
  info.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();
  const VkResult result = vkCreateInstance(&info, nullptr, &state.instance);
  if (result == VK_ERROR_INCOMPATIBLE_DRIVER) throwNoDevice();
  checkVulkan(result, "vkCreateInstance");
  if (validation) createMessenger(state, messenger);
}

}  // namespace probelab
