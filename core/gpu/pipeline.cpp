// SPDX-License-Identifier: Apache-2.0
#include "gpu/pipeline.h"

#include "pipeline_state.h"

namespace probelab {
namespace {

void checkLimits(const DeviceInfo& device, const std::string& name,
                 const PipelineOptions& options) {
  PROBELAB_CHECK(options.push_constant_bytes % 4 == 0);
  if (options.buffer_count > device.max_storage_buffers_per_stage)
    throw DeviceError(fmt::format("shader {} needs {} storage buffers, the device allows {}", name,
                                  options.buffer_count, device.max_storage_buffers_per_stage));
  const auto check_images = [&](std::uint32_t count, std::uint32_t limit, const char* kind) {
    if (count > limit)
      throw DeviceError(fmt::format("shader {} needs {} {} images, the device allows {}", name,
                                    count, kind, limit));
  };
  check_images(options.storage_image_count, device.max_storage_images_per_stage, "storage");
  check_images(options.sampled_image_count, device.max_sampled_images_per_stage, "sampled");
  if (options.push_constant_bytes > device.max_push_constant_bytes)
    throw DeviceError(
        fmt::format("shader {} needs {} bytes of push constants, the device allows {}", name,
                    options.push_constant_bytes, device.max_push_constant_bytes));
  if (options.acceleration_structure && !device.ray_query)
    throw DeviceError(fmt::format("shader {} needs ray queries, which device '{}' does not have",
                                  name, device.name));
}

const std::vector<std::uint32_t>& compiledOnce(VulkanState& state, const ShaderSource& source) {
  std::string key = source.name + '\0' + source.text;
  for (const auto& [name, value] : source.defines) key += '\0' + name + '\0' + value;
  const auto known = state.shaders.find(key);
  if (known != state.shaders.end()) return known->second;
  return state.shaders.emplace(std::move(key), compileShader(source)).first->second;
}

void createLayouts(const VulkanState& state, PipelineState& pipeline) {
  const PipelineOptions& options = pipeline.options;
  std::vector<VkDescriptorSetLayoutBinding> bindings;
  const auto add = [&](VkDescriptorType type) {
    bindings.push_back({static_cast<std::uint32_t>(bindings.size()), type, 1,
                        VK_SHADER_STAGE_COMPUTE_BIT, nullptr});
  };
  for (std::uint32_t i = 0; i < options.buffer_count; ++i)
    add(isUniformBuffer(options, i) ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER
                                    : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER);
  if (options.acceleration_structure) add(VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR);
  for (std::uint32_t i = 0; i < options.storage_image_count; ++i)
    add(VK_DESCRIPTOR_TYPE_STORAGE_IMAGE);
  for (std::uint32_t i = 0; i < options.sampled_image_count; ++i)
    add(VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER);
  VkDescriptorSetLayoutCreateInfo set_info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO};
  set_info.bindingCount = static_cast<std::uint32_t>(bindings.size());
  set_info.pBindings = bindings.data();
  VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
  checkVulkan(vkCreateDescriptorSetLayout(state.device, &set_info, nullptr, &set_layout),
              "vkCreateDescriptorSetLayout", pipeline.name);
  pipeline.set_layout = {state.device, set_layout, vkDestroyDescriptorSetLayout};

  const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, options.push_constant_bytes};
  VkPipelineLayoutCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
  info.setLayoutCount = 1;
  info.pSetLayouts = &set_layout;
  info.pushConstantRangeCount = options.push_constant_bytes > 0 ? 1 : 0;
  info.pPushConstantRanges = &push;
  VkPipelineLayout layout = VK_NULL_HANDLE;
  checkVulkan(vkCreatePipelineLayout(state.device, &info, nullptr, &layout),
              "vkCreatePipelineLayout", pipeline.name);
  pipeline.layout = {state.device, layout, vkDestroyPipelineLayout};
}

void createVkPipeline(const VulkanState& state, PipelineState& pipeline) {
  VkShaderModuleCreateInfo module_info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
  module_info.codeSize = pipeline.spirv.size() * sizeof(std::uint32_t);
  module_info.pCode = pipeline.spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  checkVulkan(vkCreateShaderModule(state.device, &module_info, nullptr, &module),
              "vkCreateShaderModule", pipeline.name);
  const Handle<VkShaderModule> owned_module(state.device, module, vkDestroyShaderModule);

  VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.layout = pipeline.layout.get();
  VkPipeline handle = VK_NULL_HANDLE;
  checkVulkan(vkCreateComputePipelines(state.device, VK_NULL_HANDLE, 1, &info, nullptr, &handle),
              "vkCreateComputePipelines", pipeline.name);
  pipeline.pipeline = {state.device, handle, vkDestroyPipeline};
  setName(state, VK_OBJECT_TYPE_PIPELINE, handle, pipeline.name);
}

}  // namespace

ComputePipeline::ComputePipeline() = default;
ComputePipeline::ComputePipeline(std::unique_ptr<PipelineState> state) : state_(std::move(state)) {}
ComputePipeline::ComputePipeline(ComputePipeline&&) noexcept = default;
ComputePipeline& ComputePipeline::operator=(ComputePipeline&&) noexcept = default;
ComputePipeline::~ComputePipeline() = default;

const std::string& ComputePipeline::name() const { return state_->name; }
const PipelineOptions& ComputePipeline::options() const { return state_->options; }
std::span<const std::uint32_t> ComputePipeline::spirv() const { return state_->spirv; }

ComputePipeline createPipeline(GpuContext& context, const ShaderSource& source,
                               const PipelineOptions& options) {
  checkLimits(context.info(), source.name, options);
  auto pipeline = std::make_unique<PipelineState>();
  pipeline->name = source.name;
  pipeline->options = options;
  pipeline->spirv = compiledOnce(context.state(), source);
  createLayouts(context.state(), *pipeline);
  createVkPipeline(context.state(), *pipeline);
  return ComputePipeline(std::move(pipeline));
}

}  // namespace probelab
