// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab compare`: metrics of an image against a reference image, HDR-FLIP, a signed error map.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "commands.h"
#include "image/compose.h"
#include "image/exr.h"
#include "image/png.h"
#include "image/tonemap.h"
#include "json.h"
#include "metrics/flip.h"
#include "metrics/image_metrics.h"
#include "program.h"
#include "provenance.h"
#include "require.h"
#include "table.h"

namespace probelab {
namespace {

struct CompareOptions {
  std::string image, reference, output, layer;
  std::optional<double> flip_start, flip_stop, scale;
  std::vector<std::string> require;
};

struct FlipChoice {
  std::optional<FlipExposureRange> range;
  std::string source;  // "options", "reference" or "automatic"; else why there is none
};

// The number in an attribute that `probelab reference` wrote from the scene's [flip].
std::optional<double> numberAttribute(const ImageFile& file, const std::string& name) {
  const auto found = file.attributes.find(name);
  if (found == file.attributes.end()) return std::nullopt;
  char* end = nullptr;
  const double value = std::strtod(found->second.c_str(), &end);
  if (found->second.empty() || *end != '\0' || !std::isfinite(value)) return std::nullopt;
  return value;
}

// Exposures from the options, else from the reference's scene, else automatic.
FlipChoice chooseExposures(const CompareOptions& options, const ImageFile& reference,
                           const std::vector<Vec3f>& pixels) {
  if (options.flip_start.has_value() != options.flip_stop.has_value())
    throwInput("compare: give both --flip-start and --flip-stop, or neither");
  if (options.flip_start) {
    if (*options.flip_stop < *options.flip_start)
      throwInput("compare: --flip-stop {} is below --flip-start {}", *options.flip_stop,
                 *options.flip_start);
    return {flipExposures(*options.flip_start, *options.flip_stop), "options"};
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

void checkSameSize(const CompareOptions& options, const Image& image, const Image& reference) {
  if (image.width != reference.width || image.height != reference.height)
    throwInput("{}: is {} x {} pixels, but {} is {} x {}; render both at one size", options.image,
               image.width, image.height, options.reference, reference.width, reference.height);
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

// Against the reference's halves where it has them, so that its noise is not in nrmse.
ImageMetrics measure(const CompareOptions& options, const ImageFile& reference,
                     const std::vector<Vec3f>& pixels, const std::vector<Vec3f>& truth) {
  const auto a = reference.layers.find("half_a"), b = reference.layers.find("half_b");
  if (!options.layer.empty() || a == reference.layers.end() || b == reference.layers.end())
    return computeImageMetrics(pixels, truth);
  return computeImageMetrics(pixels, finitePixels(a->second, options.reference),
                             finitePixels(b->second, options.reference));
}

void writeErrorMap(const CompareOptions& options, const Image& image, const Image& reference) {
  const double automatic = suggestedErrorScale(image, reference);
  const double wanted = options.scale.value_or(automatic);
  const float scale = wanted > 0 ? static_cast<float>(wanted) : 1.0f;
  const Panel panel = {"image - reference, luminance", signedErrorMap(image, reference, scale),
                       signedErrorLegend(scale)};
  writePng(options.output, composePanels({&panel, 1}));
}

void printTable(const Json& result) {
  std::vector<std::pair<std::string, std::string>> fields;
  for (const auto& [name, value] : result["error"].items())
    fields.emplace_back(name, value.is_null() ? "-" : formatNumber(value.get<double>()));
  fmt::print("{}", formatFields(fields));
}

void runCompare(const CompareOptions& options, const Invocation& invocation) {
  if (!options.output.empty()) checkOutput(options.output, ".png");
  const ImageFile image_file = readExr(options.image);
  const ImageFile reference_file = readExr(options.reference);
  const Image& image = layerOf(image_file, options.layer, options.image);
  const Image& reference = layerOf(reference_file, options.layer, options.reference);
  checkSameSize(options, image, reference);
  const std::vector<Vec3f> pixels = finitePixels(image, options.image);
  const std::vector<Vec3f> truth = finitePixels(reference, options.reference);

  Json error;
  for (const auto& [name, value] : namedMetrics(measure(options, reference_file, pixels, truth)))
    error[std::string(name)] = optionalNumber(value);
  const FlipChoice flip = chooseExposures(options, reference_file, truth);
  Json result = {{"image", options.image},   {"reference", options.reference},
                 {"layer", options.layer},   {"width", image.width},
                 {"height", image.height},   {"warnings", Json::array()},
                 {"flip_exposures", nullptr}};
  error["flip"] = nullptr;
  if (flip.range) {
    error["flip"] = hdrFlip(truth, pixels, image.width, image.height, *flip.range).mean;
    result["flip_exposures"] = {{"start", flip.range->start},
                                {"stop", flip.range->stop},
                                {"count", flip.range->count},
                                {"source", flip.source}};
  } else {
    result["warnings"].push_back("no HDR-FLIP: " + flip.source);
    note(invocation, "no HDR-FLIP: {}", flip.source);
  }
  result["error"] = error;
  result["provenance"] = toJson(makeProvenance(invocation));
  if (!options.output.empty()) writeErrorMap(options, image, reference);
  if (invocation.common.json)
    printJson(result);
  else
    printTable(result);
  checkRequirements(options.require, result);
}

}  // namespace

void addCompareCommand(Program& program) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App& app = program.addCommand(
      "compare", "metrics of an image against a reference image, and a signed error map",
      "probelab compare ddgi.exr reference.exr -o error.png --require 'nrmse<=0.1'",
      [options](const Invocation& invocation) { runCompare(*options, invocation); });
  app.add_option("A.exr", options->image, "the image to judge")->required();
  app.add_option("REF.exr", options->reference, "the reference, of the same size")->required();
  addOutputOption(app, options->output, "ERROR.png",
                  "signed error map: red is too bright, blue too dark", false);
  addRequireOption(app, options->require);
  app.add_option("--layer", options->layer,
                 "layer of both files, such as irradiance (default: the main one)")
      ->type_name("NAME")
      ->group("Metrics");
  app.add_option("--flip-start", options->flip_start,
                 "first exposure of HDR-FLIP, in stops (default: the scene's, else automatic)")
      ->type_name("EV")
      ->check(checkFinite)
      ->group("Metrics");
  app.add_option("--flip-stop", options->flip_stop, "last exposure of HDR-FLIP, in stops")
      ->type_name("EV")
      ->check(checkFinite)
      ->group("Metrics");
  app.add_option("--scale", options->scale,
                 "luminance difference with the map's fullest colours (default: automatic)")
      ->type_name("L")
      ->check(checkPositive)
      ->group("Metrics");
}

}  // namespace probelab
