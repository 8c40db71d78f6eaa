// SPDX-License-Identifier: GPL-3.0-or-later
// The Vulkan device that --device and --validation ask for.
#pragma once

#include "gpu/context.h"
#include "program.h"
#include "provenance.h"

namespace probelab {

// Opens the device; DeviceError where there is none. Its names go into the provenance.
GpuContext openDevice(const Invocation& invocation, Provenance& provenance);

// Throws DeviceError with the first message when the validation layers had something to say.
void requireNoValidationMessages(const GpuContext& gpu);

}  // namespace probelab
