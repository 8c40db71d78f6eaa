// SPDX-License-Identifier: Apache-2.0
#include "image/image.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "base/error.h"

namespace probelab {

Image makeImage(int width, int height, std::vector<std::string> channels) {
  PROBELAB_CHECK(width > 0 && height > 0 && !channels.empty());
  Image image{width, height, std::move(channels), {}};
  image.data.resize(image.pixelCount() * image.channels.size());
  return image;
}

Image imageFromPixels(int width, int height, std::span<const Vec3f> pixels,
                      const std::vector<std::string>& channels) {
  PROBELAB_CHECK_EQ(channels.size(), std::size_t{3});
  Image image = makeImage(width, height, channels);
  PROBELAB_CHECK_EQ(pixels.size(), image.pixelCount());
  for (std::size_t i = 0; i < pixels.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) image.data[3 * i + c] = pixels[i][c];
  return image;
}

Image imageFromValues(int width, int height, std::span<const float> values,
                      const std::string& channel) {
  Image image = makeImage(width, height, {channel});
  PROBELAB_CHECK_EQ(values.size(), image.pixelCount());
  image.data.assign(values.begin(), values.end());
  return image;
}

int channelIndex(const Image& image, std::string_view name) {
  const auto found = std::find(image.channels.begin(), image.channels.end(), name);
  return found == image.channels.end() ? -1 : static_cast<int>(found - image.channels.begin());
}

std::vector<Vec3f> pixelsOf(const Image& image) {
  std::array<int, 3> index = {channelIndex(image, "R"), channelIndex(image, "G"),
                              channelIndex(image, "B")};
  if (index[0] < 0 || index[1] < 0 || index[2] < 0)
    index = {channelIndex(image, "X"), channelIndex(image, "Y"), channelIndex(image, "Z")};
  if (image.channels.size() == 1) index = {0, 0, 0};
  if (index[0] < 0 || index[1] < 0 || index[2] < 0)
    throwInput("image: channels R, G, B are needed, there are: {}",
               fmt::join(image.channels, ", "));
  std::vector<Vec3f> pixels(image.pixelCount());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const float* texel = image.data.data() + i * image.channels.size();
    pixels[i] = {texel[index[0]], texel[index[1]], texel[index[2]]};
  }
  return pixels;
}

const Image& layerOf(const ImageFile& file, const std::string& layer, const std::string& path) {
  const auto found = file.layers.find(layer);
  if (found != file.layers.end()) return found->second;
  std::vector<std::string> names;
  for (const auto& [name, image] : file.layers) names.push_back(name.empty() ? "(main)" : name);
  throwInput("{}: there is no layer '{}', there are: {}", path, layer.empty() ? "(main)" : layer,
             fmt::join(names, ", "));
}

}  // namespace probelab
