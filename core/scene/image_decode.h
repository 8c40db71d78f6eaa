// SPDX-License-Identifier: Apache-2.0
// PNG and JPEG -> 8-bit RGBA, for textures.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "scene/scene.h"

namespace probelab {

// Nothing, and the reason in `why`, when the bytes cannot be decoded. 16-bit images lose their
// lower byte.
std::optional<Texture> decodeImage(std::span<const uint8_t> bytes, std::string& why);

}  // namespace probelab
