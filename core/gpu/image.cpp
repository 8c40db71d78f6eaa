// SPDX-License-Identifier: Apache-2.0
// Images with a memory allocation, a view of all layers and a sampler each.
#include "gpu/image.h"

#include <cstring>

#include "vulkan_state.h"

namespace probelab {
namespace {

struct FormatInfo {
  VkFormat format;
  const char* glsl_name;
  std::uint32_t bytes;
};

FormatInfo formatInfo(ImageFormat format) {
  switch (format) {
    case ImageFormat::rgba16f:
      return {VK_FORMAT_R16G16B16A16_SFLOAT, "rgba16f", 8};
    case ImageFormat::rgba32f:
      return {VK_FORMAT_R32G32B32A32_SFLOAT, "rgba32f", 16};
    case ImageFormat::rg16f:
      return {VK_FORMAT_R16G16_SFLOAT, "rg16f", 4};
    case ImageFormat::rg32f:
      return {VK_FORMAT_R32G32_SFLOAT, "rg32f", 8};
  }
  PROBELAB_CHECK(!"an image format");
  return {};
}

std::string sizeLabel(const ImageState& image) {
  return fmt::format("image '{}' of {} x {} x {} texels", image.name, image.size.width,
                     image.size.height, image.size.layers);
}

void checkLimits(const VulkanState& state, const ImageState& image, const std::string& label) {
  const DeviceInfo& device = state.physical.info;
  const ImageSize& size = image.size;
  PROBELAB_CHECK(size.width > 0 && size.height > 0 && size.layers > 0);
  if (size.width > device.max_image_side || size.height > device.max_image_side ||
      size.layers > device.max_image_layers)
    throw DeviceError(fmt::format("{}: the device allows {} texels a side and {} layers", label,
                                  device.max_image_side, device.max_image_layers));
  const FormatInfo format = formatInfo(image.format);
  VkFormatProperties properties{};
  vkGetPhysicalDeviceFormatProperties(state.physical.handle, format.format, &properties);
  constexpr VkFormatFeatureFlags needed =
      VK_FORMAT_FEATURE_STORAGE_IMAGE_BIT | VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT |
      VK_FORMAT_FEATURE_TRANSFER_SRC_BIT | VK_FORMAT_FEATURE_TRANSFER_DST_BIT;
  const bool two_channels =
      image.format == ImageFormat::rg16f || image.format == ImageFormat::rg32f;
  if ((properties.optimalTilingFeatures & needed) != needed ||
      (two_channels && !device.two_channel_storage_images))
    throw DeviceError(
        fmt::format("{}: the device cannot store and filter {}", label, format.glsl_name));
}

void createVkImage(ImageState& image, const std::string& label) {
  const VulkanState& state = *image.vulkan;
  VkImageCreateInfo info{VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO};
  info.imageType = VK_IMAGE_TYPE_2D;
  info.format = formatInfo(image.format).format;
  info.extent = {image.size.width, image.size.height, 1};
  info.mipLevels = 1;
  info.arrayLayers = image.size.layers;
  info.samples = VK_SAMPLE_COUNT_1_BIT;
  info.tiling = VK_IMAGE_TILING_OPTIMAL;
  info.usage = VK_IMAGE_USAGE_STORAGE_BIT | VK_IMAGE_USAGE_SAMPLED_BIT |
               VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  info.initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  VkImage handle = VK_NULL_HANDLE;
  checkVulkan(vkCreateImage(state.device, &info, nullptr, &handle), "vkCreateImage", label);
  image.image = {state.device, handle, vkDestroyImage};
  setName(state, VK_OBJECT_TYPE_IMAGE, handle, image.name);

  VkMemoryRequirements needs{};
  vkGetImageMemoryRequirements(state.device, handle, &needs);
  VkMemoryAllocateInfo allocate{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
  allocate.allocationSize = needs.size;
  allocate.memoryTypeIndex =
      chooseMemoryType(state, needs.memoryTypeBits, MemoryUse::device, label);
  VkDeviceMemory memory = VK_NULL_HANDLE;
  checkVulkan(vkAllocateMemory(state.device, &allocate, nullptr, &memory), "vkAllocateMemory",
              label);
  image.memory = {state.device, memory, vkFreeMemory};
  setName(state, VK_OBJECT_TYPE_DEVICE_MEMORY, memory, image.name);
  checkVulkan(vkBindImageMemory(state.device, handle, memory, 0), "vkBindImageMemory", label);
}

void createView(ImageState& image) {
  const VulkanState& state = *image.vulkan;
  VkImageViewCreateInfo info{VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO};
  info.image = image.image.get();
  info.viewType = VK_IMAGE_VIEW_TYPE_2D_ARRAY;
  info.format = formatInfo(image.format).format;
  info.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, image.size.layers};
  VkImageView view = VK_NULL_HANDLE;
  checkVulkan(vkCreateImageView(state.device, &info, nullptr, &view), "vkCreateImageView",
              image.name);
  image.view = {state.device, view, vkDestroyImageView};
  setName(state, VK_OBJECT_TYPE_IMAGE_VIEW, view, image.name);
}

void createSampler(ImageState& image) {
  const VulkanState& state = *image.vulkan;
  VkSamplerCreateInfo info{VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO};
  info.magFilter = VK_FILTER_LINEAR;
  info.minFilter = VK_FILTER_LINEAR;
  info.mipmapMode = VK_SAMPLER_MIPMAP_MODE_NEAREST;
  info.addressModeU = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
  info.addressModeV = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
  info.addressModeW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
  VkSampler sampler = VK_NULL_HANDLE;
  checkVulkan(vkCreateSampler(state.device, &info, nullptr, &sampler), "vkCreateSampler",
              image.name);
  image.sampler = {state.device, sampler, vkDestroySampler};
  setName(state, VK_OBJECT_TYPE_SAMPLER, sampler, image.name);
}

VkBufferImageCopy wholeImage(const ImageState& image) {
  VkBufferImageCopy region{};
  region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, image.size.layers};
  region.imageExtent = {image.size.width, image.size.height, 1};
  return region;
}

GpuBuffer transferBuffer(VulkanState& state, std::size_t bytes) {
  return createRawBuffer(state, bytes, MemoryUse::host_visible,
                         VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                         "image transfer");
}

}  // namespace

const char* glslName(ImageFormat format) { return formatInfo(format).glsl_name; }
std::uint32_t texelBytes(ImageFormat format) { return formatInfo(format).bytes; }

GpuImage::GpuImage() = default;
GpuImage::GpuImage(std::unique_ptr<ImageState> state) : state_(std::move(state)) {}
GpuImage::GpuImage(GpuImage&&) noexcept = default;
GpuImage& GpuImage::operator=(GpuImage&&) noexcept = default;
GpuImage::~GpuImage() = default;

const std::string& GpuImage::name() const { return state_->name; }
ImageFormat GpuImage::format() const { return state_->format; }
ImageSize GpuImage::size() const { return state_->size; }
std::size_t GpuImage::bytes() const {
  const ImageSize& s = state_->size;
  return std::size_t{s.width} * s.height * s.layers * texelBytes(state_->format);
}

VkImageLayout layoutOf(ImageUse use) {
  return use == ImageUse::storage ? VK_IMAGE_LAYOUT_GENERAL
                                  : VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
}

void recordClear(const CommandBuffer& commands, const ImageState& image) {
  const VkClearColorValue zero{};
  const VkImageSubresourceRange range{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, image.size.layers};
  vkCmdClearColorImage(commands.commands, image.image.get(), image.layout, &zero, 1, &range);
}

GpuImage createImage(GpuContext& context, ImageFormat format, const ImageSize& size,
                     std::string name) {
  VulkanState& state = context.state();
  auto image = std::make_unique<ImageState>();
  image->vulkan = &state;
  image->name = std::move(name);
  image->format = format;
  image->size = size;
  const std::string label = sizeLabel(*image);
  checkLimits(state, *image, label);
  createVkImage(*image, label);
  createView(*image);
  createSampler(*image);
  beginCommands(state, state.transfer);
  recordLayout(state.transfer, *image, layoutOf(ImageUse::storage));
  recordClear(state.transfer, *image);
  submitCommands(state, state.transfer);
  return GpuImage(std::move(image));
}

void upload(GpuContext& context, GpuImage& image, std::span<const std::byte> data) {
  PROBELAB_CHECK_EQ(data.size(), image.bytes());
  VulkanState& state = context.state();
  ImageState& target = image.state();
  const GpuBuffer buffer = transferBuffer(state, data.size());
  std::memcpy(buffer.mapped(), data.data(), data.size());
  const VkImageLayout layout = target.layout;
  const VkBufferImageCopy region = wholeImage(target);
  beginCommands(state, state.transfer);
  recordLayout(state.transfer, target, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
  vkCmdCopyBufferToImage(state.transfer.commands, buffer.state().buffer.get(), target.image.get(),
                         target.layout, 1, &region);
  recordLayout(state.transfer, target, layout);
  submitCommands(state, state.transfer);
}

void download(GpuContext& context, GpuImage& image, std::span<std::byte> data) {
  PROBELAB_CHECK_EQ(data.size(), image.bytes());
  VulkanState& state = context.state();
  ImageState& source = image.state();
  const GpuBuffer buffer = transferBuffer(state, data.size());
  const VkImageLayout layout = source.layout;
  const VkBufferImageCopy region = wholeImage(source);
  beginCommands(state, state.transfer);
  recordLayout(state.transfer, source, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
  vkCmdCopyImageToBuffer(state.transfer.commands, source.image.get(), source.layout,
                         buffer.state().buffer.get(), 1, &region);
  recordLayout(state.transfer, source, layout);
  submitCommands(state, state.transfer);
  std::memcpy(data.data(), buffer.mapped(), data.size());
}

}  // namespace probelab
