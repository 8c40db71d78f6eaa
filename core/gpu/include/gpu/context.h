// SPDX-License-Identifier: Apache-2.0
// A Vulkan 1.3 device with one compute queue, and what there is to choose from. Every other object
// of this library refers to its context, which must outlive it. One thread at a time may use a
// context and what was made from it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace probelab {

struct DeviceOptions {
  // "": the best suitable device (discrete, integrated, virtual, CPU). Otherwise an index into
  // listDevices() or a part of the name, in any case of letters.
  std::string device;
  // The Khronos layer with synchronization validation; its warnings and errors are collected.
  bool validation = false;
  // Validation messages also go to stderr as they come.
  bool print_validation = false;
  // false: the ray-query extensions stay off even where the device has them.
  bool ray_query = true;
  // Device memory counts as not host-visible and mapped memory as not coherent, so that a CPU
  // device takes the paths of a discrete GPU (tests).
  bool act_discrete = false;
};

struct DeviceInfo {
  std::string name;
  std::string driver;       // name and version text
  std::string api_version;  // "1.3.277"
  std::string type;         // "discrete GPU", "integrated GPU", "virtual GPU", "CPU" or "other"
  bool is_cpu = false;
  bool ray_query = false;  // VK_KHR_ray_query and VK_KHR_acceleration_structure can be used
  std::uint64_t max_storage_buffer_range = 0;  // bytes
  std::uint64_t max_buffer_size = 0;           // bytes, for buffers that no shader binds
  std::uint64_t device_local_bytes = 0;        // of the largest device-local heap
  std::uint32_t max_workgroup_invocations = 0;
  std::array<std::uint32_t, 3> max_workgroup_size{};
  std::array<std::uint32_t, 3> max_workgroup_count{};
  std::uint32_t max_shared_memory_bytes = 0;
  std::uint32_t max_push_constant_bytes = 0;
  std::uint32_t max_storage_buffers_per_stage = 0;
  std::uint32_t max_storage_images_per_stage = 0;
  std::uint32_t max_sampled_images_per_stage = 0;
  std::uint32_t max_image_side = 0;  // texels, of a two-dimensional image
  std::uint32_t max_image_layers = 0;
  bool two_channel_storage_images = false;  // shaderStorageImageExtendedFormats: rg16f, rg32f
  std::uint32_t subgroup_size = 0;
  std::uint32_t timestamp_valid_bits = 0;
  float timestamp_period_ns = 0;
  std::vector<std::string> missing;  // what Probelab needs and the device lacks; empty = suitable
};

// All devices, suitable or not, in the loader's order; empty without a loader, driver or device.
std::vector<DeviceInfo> listDevices();

// The index of the device that `wanted` names (see DeviceOptions::device). DeviceError, listing the
// devices, when there is none, more than one match, or the match lacks something.
std::size_t chooseDevice(std::span<const DeviceInfo> devices, const std::string& wanted);

struct VulkanState;

class GpuContext {
 public:
  // DeviceError when there is no such device, a required feature or the validation layer is
  // missing.
  explicit GpuContext(const DeviceOptions& options);
  GpuContext(GpuContext&&) noexcept;
  GpuContext& operator=(GpuContext&&) noexcept;
  ~GpuContext();

  const DeviceInfo& info() const;
  // Warnings and errors so far, oldest first; always empty without validation. Valid until the next
  // call that uses the device.
  std::span<const std::string> validationMessages() const;
  VulkanState& state() const { return *state_; }

 private:
  std::unique_ptr<VulkanState> state_;
};

}  // namespace probelab
