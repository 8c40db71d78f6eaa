// SPDX-License-Identifier: Apache-2.0
// The table that embed_shaders.cmake writes from core/shaders. Not exported.
#pragma once

#include <span>
#include <string_view>

namespace probelab {

struct EmbeddedShader {
  std::string_view name;
  std::string_view text;
};

std::span<const EmbeddedShader> embeddedShaders();  // sorted by name

}  // namespace probelab
