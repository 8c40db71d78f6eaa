// SPDX-License-Identifier: Apache-2.0
// GLSL to SPIR-V with the glslang library and the optimiser of SPIRV-Tools.
#include "gpu/shader.h"

#include <glslang/Public/ResourceLimits.h>
#include <glslang/Public/ShaderLang.h>
#include <glslang/SPIRV/GlslangToSpv.h>

#include <algorithm>
#include <spirv-tools/optimizer.hpp>
#include <sstream>

#include "base/error.h"
#include "base/suggest.h"
#include "embedded_shaders.h"

namespace probelab {
namespace {

// glslang's tables are the process's own and are counted; kept from the first use to the end,
// because building them takes longer than compiling a small shader.
void startGlslang() {
  struct Process {
    Process() { glslang::InitializeProcess(); }
    ~Process() { glslang::FinalizeProcess(); }
  };
  static const Process process;
}

const EmbeddedShader* findShader(std::string_view name) {
  const auto shaders = embeddedShaders();
  const auto found =
      std::find_if(shaders.begin(), shaders.end(),
                   [&](const EmbeddedShader& shader) { return shader.name == name; });
  return found == shaders.end() ? nullptr : &*found;
}

class EmbeddedIncluder : public glslang::TShader::Includer {
 public:
  IncludeResult* includeLocal(const char* header, const char* includer, std::size_t) override {
    const EmbeddedShader* shader = findShader(header);
    if (shader == nullptr) {
      const std::string_view from(includer);
      const std::size_t slash = from.rfind('/');
      if (slash != std::string_view::npos)
        shader = findShader(std::string(from.substr(0, slash + 1)) + header);
    }
    if (shader == nullptr) return nullptr;
    return new IncludeResult(std::string(shader->name), shader->text.data(), shader->text.size(),
                             nullptr);
  }
  IncludeResult* includeSystem(const char*, const char*, std::size_t) override { return nullptr; }
  void releaseInclude(IncludeResult* result) override { delete result; }
};

// glslang writes "ERROR: file:line: message"; keeps those lines, without the prefix and the
// closing summaries, at most ten.
std::string errorLines(const std::string& log) {
  std::istringstream lines(log);
  std::string line, text;
  int count = 0;
  while (std::getline(lines, line)) {
    constexpr std::string_view prefix = "ERROR: ";
    if (!line.starts_with(prefix) || line.find("compilation errors") != std::string::npos) continue;
    if (++count > 10) break;
    text += "\n  " + line.substr(prefix.size());
  }
  return text.empty() ? "\n  " + log : text;
}

[[noreturn]] void throwCompileError(const ShaderSource& source, const std::string& log) {
  std::string defines;
  for (const auto& [name, value] : source.defines) defines += " " + name + "=" + value;
  throw Error(fmt::format("shader {} does not compile{}{}:{}", source.name,
                          defines.empty() ? "" : " with", defines, errorLines(log)));
}

std::vector<std::uint32_t> compileGlsl(const ShaderSource& source, std::string_view text) {
  std::string preamble = "#extension GL_GOOGLE_include_directive : enable\n";
  for (const auto& [name, value] : source.defines)
    preamble += "#define " + name + " " + value + "\n";

  const char* strings[] = {text.data()};
  const int lengths[] = {static_cast<int>(text.size())};
  const char* names[] = {source.name.c_str()};
  glslang::TShader shader(EShLangCompute);
  shader.setStringsWithLengthsAndNames(strings, lengths, names, 1);
  shader.setPreamble(preamble.c_str());
  shader.setEnvInput(glslang::EShSourceGlsl, EShLangCompute, glslang::EShClientVulkan, 100);
  shader.setEnvClient(glslang::EShClientVulkan, glslang::EShTargetVulkan_1_3);
  shader.setEnvTarget(glslang::EShTargetSpv, glslang::EShTargetSpv_1_6);
  const auto messages = static_cast<EShMessages>(EShMsgSpvRules | EShMsgVulkanRules);
  EmbeddedIncluder includer;
  if (!shader.parse(GetDefaultResources(), 460, false, messages, includer))
    throwCompileError(source, shader.getInfoLog());
  glslang::TProgram program;
  program.addShader(&shader);
  if (!program.link(messages)) throwCompileError(source, program.getInfoLog());

  glslang::SpvOptions options;
  options.disableOptimizer = true;
  std::vector<std::uint32_t> words;
  glslang::GlslangToSpv(*program.getIntermediate(EShLangCompute), words, &options);
  return words;
}

std::vector<std::uint32_t> optimize(const std::string& name,
                                    const std::vector<std::uint32_t>& words) {
  std::string log;
  spvtools::Optimizer optimizer(SPV_ENV_VULKAN_1_3);
  optimizer.SetMessageConsumer(
      [&](spv_message_level_t level, const char*, const spv_position_t&, const char* message) {
        if (level <= SPV_MSG_ERROR) log += std::string("\n  ") + message;
      });
  optimizer.RegisterPerformancePasses();
  spvtools::OptimizerOptions options;
  options.set_run_validator(false);  // the validation layer does so, with the device's features
  std::vector<std::uint32_t> result;
  if (!optimizer.Run(words.data(), words.size(), &result, options))
    throw Error(fmt::format("shader {}: the SPIR-V optimiser failed:{}", name, log));
  return result;
}

}  // namespace

std::vector<std::uint32_t> compileShader(const ShaderSource& source) {
  startGlslang();
  const std::string_view text =
      source.text.empty() ? shaderText(source.name) : std::string_view(source.text);
  return optimize(source.name, compileGlsl(source, text));
}

std::vector<std::string> shaderFiles() {
  std::vector<std::string> names;
  for (const EmbeddedShader& shader : embeddedShaders()) names.emplace_back(shader.name);
  return names;
}

std::string_view shaderText(const std::string& name) {
  const EmbeddedShader* shader = findShader(name);
  if (shader == nullptr) throwInput("no shader file '{}'{}", name, suggestion(name, shaderFiles()));
  return shader->text;
}

}  // namespace probelab
