// SPDX-License-Identifier: GPL-3.0-or-later
#include "compare_images.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "image/compose.h"
#include "image/png.h"
#include "image/tonemap.h"
#include "metrics/flip.h"
#include "metrics/image_metrics.h"
#include "table.h"

namespace probelab {
namespace {

struct FlipChoice {
  std::optional<FlipExposureRange> range;
  std::string source;  // "options", "reference" or "automatic"; else why there is none
};

std::string attributeOf(const ImageFile& file, const std::string& name) {
  const auto found = file.attributes.find(name);
  return found == file.attributes.end() ? "" : found->second;
}

// The number in an attribute that `probelab reference` wrote from the scene's [flip].
std::optional<double> numberAttribute(const ImageFile& file, const std::string& name) {
  const std::string text = attributeOf(file, name);
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value)) return std::nullopt;
  return value;
}

FlipChoice chooseExposures(const FlipOptions& options, const ImageFile& reference,
                           const std::vector<Vec3f>& pixels) {
  if (options.start.has_value() != options.stop.has_value())
    throwInput("give both --flip-start and --flip-stop, or neither");
  if (options.start) {
    if (*options.stop < *options.start)
      throwInput("--flip-stop {} is below --flip-start {}", *options.stop, *options.start);
    return {flipExposures(*options.start, *options.stop), "options"};
  }
  const auto start = numberAttribute(reference, "probelab:flip_start");
  const auto stop = numberAttribute(reference, "probelab:flip_stop");
  if (start && stop && *start <= *stop) return {flipExposures(*start, *stop), "reference"};
  try {
    return {automaticFlipExposures(pixels), "automatic"};
  } catch (const InputError& error) {
    return {std::nullopt, error.what()};
  }
}

std::vector<Vec3f> finitePixels(const Image& image, const std::string& path) {
  std::vector<Vec3f> pixels = pixelsOf(image);
  for (std::size_t i = 0; i < pixels.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c)
      if (!std::isfinite(pixels[i][c]))
        throwInput("{}: pixel ({}, {}) is not finite; no metric means anything then", path,
                   i % image.width, i / image.width);
  return pixels;
}

void checkSameSize(const LoadedImage& a, const LoadedImage& b) {
  const Image &x = a.image(), &y = b.image();
  if (x.width != y.width || x.height != y.height)
    throwInput("{}: is {} x {} pixels, but {} is {} x {}; render both at one size", a.path, x.width,
               x.height, b.path, y.width, y.height);
}

ImageMetrics measure(const std::vector<Vec3f>& pixels, const std::vector<Vec3f>& truth,
                     const LoadedImage& reference) {
  const auto& layers = reference.file.layers;
  const auto a = layers.find("half_a"), b = layers.find("half_b");
  if (!reference.layer.empty() || a == layers.end() || b == layers.end())
    return computeImageMetrics(pixels, truth);
  return computeImageMetrics(pixels, finitePixels(a->second, reference.path),
                             finitePixels(b->second, reference.path));
}

float errorScale(const LoadedImage& image, const LoadedImage& reference,
                 std::optional<double> scale) {
  const auto wanted =
      static_cast<float>(scale.value_or(suggestedErrorScale(image.image(), reference.image())));
  return wanted > 0 ? wanted : 1.0f;  // equal images: any scale shows white
}

Panel errorPanel(const LoadedImage& image, const LoadedImage& reference,
                 std::optional<double> scale) {
  const float s = errorScale(image, reference, scale);
  return {"signed error", signedErrorMap(image.image(), reference.image(), s),
          signedErrorLegend(s)};
}

// The parameters that made the image where its file says so, else the file's stem.
std::string labelOf(const LoadedImage& image) {
  const std::string params = attributeOf(image.file, "probelab:params");
  return params.empty() ? std::filesystem::path(image.path).stem().string() : params;
}

}  // namespace

Json compareImages(const LoadedImage& image, const LoadedImage& reference,
                   const FlipOptions& options) {
  checkSameSize(image, reference);
  const std::vector<Vec3f> pixels = finitePixels(image.image(), image.path);
  const std::vector<Vec3f> truth = finitePixels(reference.image(), reference.path);
  const int width = image.image().width, height = image.image().height;
  Json result = {{"width", width},
                 {"height", height},
                 {"layer", reference.layer},
                 {"warnings", Json::array()},
                 {"flip_exposures", nullptr}};
  Json error;
  for (const auto& [name, value] : namedMetrics(measure(pixels, truth, reference)))
    error[std::string(name)] = optionalNumber(value);
  error["flip"] = nullptr;
  const FlipChoice flip = chooseExposures(options, reference.file, truth);
  if (flip.range) {
    error["flip"] = hdrFlip(truth, pixels, width, height, *flip.range).mean;
    result["flip_exposures"] = {{"start", flip.range->start},
                                {"stop", flip.range->stop},
                                {"count", flip.range->count},
                                {"source", flip.source}};
  } else {
    result["warnings"].push_back("no HDR-FLIP: " + flip.source);
  }
  result["error"] = error;
  return result;
}

std::string formatImageErrors(const Json& comparison) {
  std::vector<std::pair<std::string, std::string>> fields;
  for (const auto& [name, value] : comparison["error"].items()) {
    std::string text = value.is_null() ? "-" : formatNumber(value.get<double>());
    if (name == "nrmse" && value.is_null()) text += "  (the reference has no halves or no light)";
    fields.emplace_back(name, text);
  }
  return formatFields(fields);
}

void writeErrorMap(const std::filesystem::path& path, const LoadedImage& image,
                   const LoadedImage& reference, std::optional<double> scale) {
  const Panel panel = errorPanel(image, reference, scale);
  writePng(path, composePanels({&panel, 1}));
}

void writePictureStrip(const std::filesystem::path& path, const LoadedImage& image,
                       const LoadedImage& reference, const std::vector<LoadedImage>& others,
                       std::optional<double> scale) {
  const ToneMapping mapping{.exposure_stops = suggestedExposure(reference.image())};
  std::vector<Panel> panels = {{"reference", toneMap(reference.image(), mapping), {}}};
  for (const LoadedImage& other : others) {
    checkSameSize(other, reference);
    panels.push_back({labelOf(other), toneMap(other.image(), mapping), {}});
  }
  panels.push_back({labelOf(image), toneMap(image.image(), mapping), {}});
  panels.push_back(errorPanel(image, reference, scale));
  panels.back().label += " of " + labelOf(image);
  writePng(path, composePanels(panels));
}

}  // namespace probelab
