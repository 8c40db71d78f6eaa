// SPDX-License-Identifier: GPL-3.0-or-later
#include "device.h"

#include <fmt/format.h>

#include "base/error.h"

namespace probelab {

GpuContext openDevice(const Invocation& invocation, Provenance& provenance) {
  DeviceOptions options;
  options.device = invocation.common.device;
  options.validation = invocation.common.validation;
  options.print_validation = invocation.common.validation;
  GpuContext gpu(options);
  provenance.device = gpu.info().name;
  provenance.driver = gpu.info().driver;
  return gpu;
}

void requireNoValidationMessages(const GpuContext& gpu) {
  const auto messages = gpu.validationMessages();
  if (!messages.empty())
    throw DeviceError(fmt::format("{} messages from the Vulkan validation layers; the first: {}",
                                  messages.size(), messages.front()));
}

}  // namespace probelab
