// SPDX-License-Identifier: GPL-3.0-or-later
// For tests on a Vulkan device. Environment: PROBELAB_VALIDATION=1 switches the validation layer
// on, and then any message fails the test; PROBELAB_DEVICE chooses the device. Without a device the
// tests are skipped.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>

#include "gpu/context.h"

namespace probelab {

inline DeviceOptions testDeviceOptions() {
  DeviceOptions options;
  const char* validation = std::getenv("PROBELAB_VALIDATION");
  options.validation = validation != nullptr && std::string_view(validation) == "1";
  if (const char* device = std::getenv("PROBELAB_DEVICE")) options.device = device;
  return options;
}

inline void expectNoValidationMessages(const GpuContext& context) {
  for (const std::string& message : context.validationMessages())
    ADD_FAILURE() << "Vulkan validation: " << message;
}

// gpu() is a context of the test's own; members of a derived class die before it.
class GpuTest : public ::testing::Test {
 protected:
  void SetUp() override { open(testDeviceOptions()); }
  void TearDown() override {
    if (context_) expectNoValidationMessages(*context_);
  }
  void open(const DeviceOptions& options) {
    if (listDevices().empty()) GTEST_SKIP() << "no Vulkan device";
    context_.emplace(options);
  }
  GpuContext& gpu() { return *context_; }

 private:
  std::optional<GpuContext> context_;
};

// Each test twice: as the device is, and with the paths of a discrete GPU (staged copies, flushed
// memory). INSTANTIATE_TEST_SUITE_P(Memory, MyTest, ::testing::Bool(), memoryModeName);
class GpuMemoryModeTest : public GpuTest, public ::testing::WithParamInterface<bool> {
 protected:
  void SetUp() override {
    DeviceOptions options = testDeviceOptions();
    options.act_discrete = GetParam();
    open(options);
  }
};

inline std::string memoryModeName(const ::testing::TestParamInfo<bool>& info) {
  return info.param ? "ActDiscrete" : "AsIs";
}

}  // namespace probelab
