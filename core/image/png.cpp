// SPDX-License-Identifier: Apache-2.0
#include "image/png.h"

#include <png.h>

#include <cstring>
#include <memory>
#include <string_view>

#include "base/error.h"
#include "base/files.h"

namespace probelab {
namespace {

constexpr uint64_t kMaxPixels = uint64_t{1} << 26;

struct PngFree {
  void operator()(png_image* image) const { png_image_free(image); }
};

png_image emptyPng() {
  png_image png;
  std::memset(&png, 0, sizeof png);
  png.version = PNG_IMAGE_VERSION;
  return png;
}

}  // namespace

void writePng(const std::filesystem::path& path, const ByteImage& image) {
  PROBELAB_CHECK(image.width > 0 && image.height > 0);
  PROBELAB_CHECK_EQ(image.rgb.size(), 3 * static_cast<std::size_t>(image.width) *
                                          static_cast<std::size_t>(image.height));
  png_image png = emptyPng();
  const std::unique_ptr<png_image, PngFree> guard(&png);
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::string bytes(size, '\0');
  if (!png_image_write_to_memory(&png, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr))
    throw Error(fmt::format("{}: cannot be written: {}", path.string(), png.message));
  writeTextFile(path, std::string_view(bytes.data(), size));
}

ByteImage readPng(const std::filesystem::path& path) {
  const std::vector<std::byte> bytes = readFile(path);
  png_image png = emptyPng();
  const std::unique_ptr<png_image, PngFree> guard(&png);
  if (!png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()))
    throwInput("{}: is not a readable PNG file: {}", path.string(), png.message);
  if (uint64_t{png.width} * png.height > kMaxPixels)
    throwInput("{}: {} x {} pixels are too many", path.string(), png.width, png.height);
  png.format = PNG_FORMAT_RGB;
  ByteImage image{static_cast<int>(png.width), static_cast<int>(png.height), {}};
  image.rgb.resize(PNG_IMAGE_SIZE(png));
  const png_color black = {0, 0, 0};
  if (!png_image_finish_read(&png, &black, image.rgb.data(), 0, nullptr))
    throwInput("{}: is damaged: {}", path.string(), png.message);
  return image;
}

}  // namespace probelab
