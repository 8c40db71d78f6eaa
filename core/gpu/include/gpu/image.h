// SPDX-License-Identifier: Apache-2.0
// Two-dimensional images with layers, which shaders write as storage images and read through a
// bilinear sampler. For comparisons with code that uses the texture units; what Probelab stores
// itself lies in buffers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "gpu/context.h"

namespace probelab {

enum class ImageFormat { rgba16f, rgba32f, rg16f, rg32f };
// The format's name in a GLSL layout, and the bytes of one texel.
const char* glslName(ImageFormat format);
std::uint32_t texelBytes(ImageFormat format);

// How shaders reach an image; Commands::setUse changes it.
enum class ImageUse {
  storage,  // image2DArray: imageLoad and imageStore
  sampled,  // sampler2DArray: bilinear, clamped to the edge, no mip levels
};

struct ImageSize {
  std::uint32_t width = 0, height = 0, layers = 1;
};

struct ImageState;

class GpuImage {
 public:
  GpuImage();  // empty: only assignment and destruction are allowed
  explicit GpuImage(std::unique_ptr<ImageState> state);
  GpuImage(GpuImage&&) noexcept;
  GpuImage& operator=(GpuImage&&) noexcept;
  ~GpuImage();

  explicit operator bool() const { return state_ != nullptr; }
  const std::string& name() const;
  ImageFormat format() const;
  ImageSize size() const;
  std::size_t bytes() const;  // of all texels
  ImageState& state() const { return *state_; }

 private:
  std::unique_ptr<ImageState> state_;
};

// A zeroed image in ImageUse::storage. DeviceError naming the image when the device cannot store or
// filter the format, a side or the number of layers exceeds its limits, or memory runs out.
GpuImage createImage(GpuContext& context, ImageFormat format, const ImageSize& size,
                     std::string name);

// Copy all texels, [layer][y][x][channel] in the image's format, and wait; the use stays. `data`
// has bytes() bytes (CHECK).
void upload(GpuContext& context, GpuImage& image, std::span<const std::byte> data);
void download(GpuContext& context, GpuImage& image, std::span<std::byte> data);

}  // namespace probelab
