// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab compare`: metrics of an image against a reference image, HDR-FLIP, a signed error map.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/files.h"
#include "commands.h"
#include "compare_images.h"
#include "image/exr.h"
#include "program.h"
#include "provenance.h"
#include "require.h"

namespace probelab {
namespace {

struct CompareOptions {
  std::string image, reference, layer, output, picture;
  std::vector<std::string> others;
  FlipOptions flip;
  std::optional<double> scale;
};

void runCompare(const CompareOptions& options, const Invocation& invocation) {
  if (!options.output.empty()) checkOutput(options.output, ".png");
  if (!options.picture.empty()) checkOutput(options.picture, ".png");
  if (!options.picture.empty() && plainPath(options.picture) == plainPath(options.output))
    throwInput("{}: -o and --picture both go there; name another", options.picture);
  const auto load = [&](const std::string& path) {
    return LoadedImage{path, readExr(path), options.layer};
  };
  const LoadedImage image = load(options.image), reference = load(options.reference);
  std::vector<LoadedImage> others;
  for (const std::string& path : options.others) others.push_back(load(path));

  Json result = {{"image", options.image}, {"reference", options.reference}};
  result.update(compareImages(image, reference, options.flip));
  result["provenance"] = toJson(makeProvenance(invocation));
  if (!options.output.empty()) writeErrorMap(options.output, image, reference, options.scale);
  if (!options.picture.empty())
    writePictureStrip(options.picture, image, reference, others, options.scale);
  for (const Json& warning : result["warnings"])
    note(invocation, "warning: {}", warning.get<std::string>());
  reportResult(invocation, result, [&] { fmt::print("{}", formatImageErrors(result)); });
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
  app.add_option("--picture", options->picture,
                 "a labelled row: reference, --beside images, the image, its signed error")
      ->type_name("ROW.png")
      ->group("Output");
  app.add_option("--beside", options->others,
                 "another image for --picture, of the same size; may be repeated")
      ->type_name("B.exr")
      ->allow_extra_args(false)
      ->group("Output");
  app.add_option("--layer", options->layer,
                 "layer of all files, such as irradiance (default: the main one)")
      ->type_name("NAME")
      ->group("Metrics");
  app.add_option("--flip-start", options->flip.start,
                 "first exposure of HDR-FLIP, in stops (default: the scene's, else automatic)")
      ->type_name("EV")
      ->check(checkFinite)
      ->group("Metrics");
  app.add_option("--flip-stop", options->flip.stop, "last exposure of HDR-FLIP, in stops")
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
