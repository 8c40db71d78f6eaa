// SPDX-License-Identifier: Apache-2.0
// GLSL compute shaders to optimised SPIR-V 1.6, at run time. The files of core/shaders are part of
// the library, so neither the working folder nor the source tree matters.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace probelab {

struct ShaderSource {
  std::string name;  // "ddgi/blend.comp.glsl", relative to core/shaders
  std::vector<std::pair<std::string, std::string>> defines;  // #define first second
  std::string text;  // when not empty the source itself, and `name` serves messages only
};

// Compiles for Vulkan 1.3 (GLSL 4.60) and runs the optimiser's performance passes: what the defines
// make unreachable is not in the result, nor are buffers and functions that only it used.
// #include "a/b.h" is looked up from core/shaders, then from the including file's folder. Error
// with "file:line: message" lines when it does not compile, InputError when there is no such file.
std::vector<std::uint32_t> compileShader(const ShaderSource& source);

// The embedded files' names, sorted, and one file's text (InputError when there is none).
std::vector<std::string> shaderFiles();
std::string_view shaderText(const std::string& name);

}  // namespace probelab
