// SPDX-License-Identifier: Apache-2.0
#include "image_decode.h"

#include <limits>
#include <memory>

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 16384
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#endif
#include <stb_image.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

namespace probelab {

std::optional<Texture> decodeImage(std::span<const uint8_t> bytes, std::string& why) {
  if (bytes.empty() || bytes.size() > std::numeric_limits<int>::max()) {
    why = "no data";
    return std::nullopt;
  }
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height,
                            &channels, 4),
      stbi_image_free);
  if (!pixels) {
    why = stbi_failure_reason();
    return std::nullopt;
  }
  Texture texture;
  texture.width = width;
  texture.height = height;
  const std::size_t size = std::size_t{4} * width * height;
  texture.rgba.assign(pixels.get(), pixels.get() + size);
  return texture;
}

}  // namespace probelab
