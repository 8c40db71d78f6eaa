// SPDX-License-Identifier: Apache-2.0
// Float images with named channels, files of several layers, and 8-bit pictures. Row 0 is the top.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/vec.h"

namespace probelab {

// Linear values, [y][x][channel]. Channel names as in EXR files: "R", "G", "B", "Z", ...
struct Image {
  int width = 0, height = 0;
  std::vector<std::string> channels;
  std::vector<float> data;

  std::size_t pixelCount() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  float& at(int x, int y, std::size_t channel) { return data[indexOf(x, y, channel)]; }
  float at(int x, int y, std::size_t channel) const { return data[indexOf(x, y, channel)]; }

 private:
  std::size_t indexOf(int x, int y, std::size_t channel) const {
    return (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
            static_cast<std::size_t>(x)) *
               channels.size() +
           channel;
  }
};

// Layers by name; "" is the main one. Their channels are stored as "direct.R", "depth.Z", and those
// of the main layer as "R", "G", "B". Names in use: "", "direct", "irradiance", "albedo", "normal"
// (X, Y, Z), "depth" (Z), "variance". All layers have one size.
struct ImageFile {
  std::map<std::string, Image> layers;
  std::map<std::string, std::string> attributes;  // provenance
};

// Zeros. Sizes must be positive.
Image makeImage(int width, int height, std::vector<std::string> channels);
// R, G, B (or the names given) of width * height pixels.
Image imageFromPixels(int width, int height, std::span<const Vec3f> pixels,
                      const std::vector<std::string>& channels = {"R", "G", "B"});
// One channel.
Image imageFromValues(int width, int height, std::span<const float> values,
                      const std::string& channel = "Y");
// The pixels' R, G, B; X, Y, Z of a layer without these; a single channel in all three. Throws
// InputError with the names there are where none of this fits.
std::vector<Vec3f> pixelsOf(const Image& image);
// Index of a channel, -1 where there is none.
int channelIndex(const Image& image, std::string_view name);

// The layer, or InputError naming the file and its layers.
const Image& layerOf(const ImageFile& file, const std::string& layer, const std::string& path);

// sRGB-encoded picture, [y][x][3].
struct ByteImage {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;
};

}  // namespace probelab
