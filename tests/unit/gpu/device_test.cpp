// SPDX-License-Identifier: GPL-3.0-or-later
// Which device is chosen, and what the errors say.
#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>

#include "base/error.h"
#include "gpu/context.h"
#include "gpu_fixture.h"

namespace probelab {
namespace {

DeviceInfo device(const std::string& name, const std::string& type) {
  DeviceInfo info;
  info.name = name;
  info.type = type;
  return info;
}

std::vector<DeviceInfo> fourDevices() {
  return {device("llvmpipe (LLVM 15)", "CPU"), device("Iris Xe", "integrated GPU"),
          device("GeForce 4090", "discrete GPU"), device("Radeon 4090 XT", "discrete GPU")};
}

std::string errorOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const DeviceError& error) {
    return error.what();
  }
  return "(no DeviceError)";
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(ChooseDevice, PrefersDiscreteThenIntegratedThenVirtualThenCpu) {
  std::vector<DeviceInfo> devices = fourDevices();
  EXPECT_EQ(chooseDevice(devices, ""), 2u);
  devices.resize(2);
  EXPECT_EQ(chooseDevice(devices, ""), 1u);
  devices[1].type = "virtual GPU";
  EXPECT_EQ(chooseDevice(devices, ""), 1u);
  devices.resize(1);
  EXPECT_EQ(chooseDevice(devices, ""), 0u);
}

TEST(ChooseDevice, SkipsUnsuitableDevicesUnlessTheyAreNamed) {
  std::vector<DeviceInfo> devices = fourDevices();
  devices[2].missing = {"scalarBlockLayout", "maintenance4"};
  EXPECT_EQ(chooseDevice(devices, ""), 3u);
  const std::string error = errorOf([&] { chooseDevice(devices, "geforce"); });
  EXPECT_TRUE(contains(error, "'GeForce 4090' lacks scalarBlockLayout, maintenance4")) << error;
  for (DeviceInfo& info : devices) info.missing = {"Vulkan 1.3"};
  EXPECT_TRUE(contains(errorOf([&] { chooseDevice(devices, ""); }), "lacks Vulkan 1.3"));
}

TEST(ChooseDevice, TakesAnIndexOrAPartOfTheName) {
  const std::vector<DeviceInfo> devices = fourDevices();
  EXPECT_EQ(chooseDevice(devices, "1"), 1u);
  EXPECT_EQ(chooseDevice(devices, "LLVMPIPE"), 0u);
  EXPECT_EQ(chooseDevice(devices, "4090 xt"), 3u);
}

TEST(ChooseDevice, NamesTheDevicesWhenNoneOrSeveralMatch) {
  const std::vector<DeviceInfo> devices = fourDevices();
  const std::string several = errorOf([&] { chooseDevice(devices, "4090"); });
  EXPECT_TRUE(contains(several, "several Vulkan devices match '4090'")) << several;
  EXPECT_TRUE(contains(several, "3: Radeon 4090 XT (discrete GPU)")) << several;
  // A part of names, but an index that is not there.
  EXPECT_TRUE(contains(errorOf([&] { chooseDevice(devices, "90"); }), "no Vulkan device matches"));
  const std::string none = errorOf([&] { chooseDevice(devices, "7"); });
  EXPECT_TRUE(contains(none, "no Vulkan device matches '7'")) << none;
  EXPECT_TRUE(contains(none, "0: llvmpipe (LLVM 15) (CPU), 1: Iris Xe (integrated GPU)")) << none;
  EXPECT_TRUE(contains(errorOf([&] { chooseDevice({}, ""); }), "no Vulkan device"));
}

class DeviceTest : public GpuTest {};

TEST_F(DeviceTest, ReportsLimitsThatVulkanGuarantees) {
  // The minima of Vulkan 1.3's table of required limits.
  const DeviceInfo& info = gpu().info();
  EXPECT_TRUE(info.missing.empty());
  EXPECT_FALSE(info.name.empty());
  EXPECT_FALSE(info.driver.empty());
  EXPECT_GE(info.max_storage_buffer_range, 1u << 27);
  EXPECT_GE(info.max_buffer_size, 1u << 30);
  EXPECT_GE(info.max_workgroup_invocations, 128u);
  EXPECT_GE(info.max_workgroup_count[0], 65535u);
  EXPECT_GE(info.max_push_constant_bytes, 128u);
  EXPECT_GE(info.max_shared_memory_bytes, 16384u);
  EXPECT_GE(info.max_storage_buffers_per_stage, 4u);
  EXPECT_GT(info.subgroup_size, 0u);
  EXPECT_GE(info.timestamp_valid_bits, 36u);
  EXPECT_GT(info.timestamp_period_ns, 0.0f);
  EXPECT_GT(info.device_local_bytes, 0u);
}

TEST_F(DeviceTest, AnUnknownNameIsAnErrorThatListsTheDevices) {
  DeviceOptions options = testDeviceOptions();
  options.device = "no such device";
  const std::string error = errorOf([&] { GpuContext context(options); });
  EXPECT_TRUE(contains(error, "no Vulkan device matches 'no such device'")) << error;
  EXPECT_TRUE(contains(error, gpu().info().name)) << error;
}

TEST_F(DeviceTest, RayQueriesCanBeSwitchedOff) {
  DeviceOptions options = testDeviceOptions();
  options.ray_query = false;
  GpuContext context(options);
  EXPECT_FALSE(context.info().ray_query);
  expectNoValidationMessages(context);
}

TEST_F(DeviceTest, AContextMoves) {
  GpuContext first(testDeviceOptions());
  const std::string name = first.info().name;
  GpuContext second(std::move(first));
  second = GpuContext(testDeviceOptions());
  EXPECT_EQ(second.info().name, name);
}

// Restores the variable at its end.
class Environment {
 public:
  Environment(const char* name, const char* value) : name_(name) {
    if (const char* old = std::getenv(name)) old_ = old;
    setenv(name, value, 1);
  }
  ~Environment() {
    if (old_)
      setenv(name_, old_->c_str(), 1);
    else
      unsetenv(name_);
  }

 private:
  const char* name_;
  std::optional<std::string> old_;
};

TEST(NoDriver, IsAClearErrorAndAnEmptyList) {
  const Environment old_variable("VK_ICD_FILENAMES", "/nonexistent.json");
  const Environment new_variable("VK_DRIVER_FILES", "/nonexistent.json");
  EXPECT_TRUE(listDevices().empty());
  const std::string error = errorOf([] { GpuContext context(DeviceOptions{}); });
  EXPECT_TRUE(contains(error, "no usable Vulkan driver") || contains(error, "no Vulkan device"))
      << error;
}

TEST(NoDriver, MissingValidationLayerIsAnErrorThatNamesIt) {
  const Environment no_layers("VK_LAYER_PATH", "/nonexistent");
  DeviceOptions options;
  options.validation = true;
  const std::string error = errorOf([&] { GpuContext context(options); });
  EXPECT_TRUE(contains(error, "VK_LAYER_KHRONOS_validation")) << error;
}

}  // namespace
}  // namespace probelab
