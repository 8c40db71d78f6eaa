// SPDX-License-Identifier: GPL-3.0-or-later
// An image against a reference: metrics, HDR-FLIP, pictures. For `compare` and `render --compare`.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "image/image.h"
#include "json.h"

namespace probelab {

// An image file with the layer that counts ("" is the main one).
struct LoadedImage {
  std::string path;
  ImageFile file;
  std::string layer;
  const Image& image() const { return layerOf(file, layer, path); }
};

// Exposures of HDR-FLIP in stops, both or neither.
struct FlipOptions {
  std::optional<double> start, stop;
};

// {width, height, layer, warnings, flip_exposures, error {...}}. Where the main layer's reference
// comes with half_a and half_b, they are used, so that nrmse holds no reference noise; without them
// nrmse is null. Exposures: the options', else the reference's scene's, else automatic; `flip` is
// null with a warning where there is none. Throws InputError when sizes differ or a pixel is not
// finite.
Json compareImages(const LoadedImage& image, const LoadedImage& reference,
                   const FlipOptions& options);

// The "error" of compareImages as text.
std::string formatImageErrors(const Json& comparison);

// The signed error of luminance with a legend; scale 0 or empty: automatic.
void writeErrorMap(const std::filesystem::path& path, const LoadedImage& image,
                   const LoadedImage& reference, std::optional<double> scale);

// One labelled row: the reference, `others`, the image, its signed error. All at one exposure.
void writePictureStrip(const std::filesystem::path& path, const LoadedImage& image,
                       const LoadedImage& reference, const std::vector<LoadedImage>& others,
                       std::optional<double> scale);

}  // namespace probelab
