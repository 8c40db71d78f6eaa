// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab reference`: a path-traced camera image with its layers as EXR, and a picture of it.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/progress.h"
#include "commands.h"
#include "image/exr.h"
#include "image/png.h"
#include "image/tonemap.h"
#include "json.h"
#include "program.h"
#include "provenance.h"
#include "require.h"
#include "scene_options.h"
#include "table.h"
#include "trace/reference_image.h"

namespace probelab {
namespace {

struct ReferenceOptions {
  SceneOptions scene;
  std::string output;
  int width = 640, height = 360;
  std::optional<double> exposure;
  SamplingOptions sampling;
};

constexpr uint32_t kDefaultSpp = 256;

ImageFile toImageFile(const ReferenceImage& r) {
  ImageFile file;
  const auto add = [&](const char* name, const std::vector<Vec3f>& pixels,
                       const std::vector<std::string>& channels = {"R", "G", "B"}) {
    file.layers[name] = imageFromPixels(r.width, r.height, pixels, channels);
  };
  add("", r.radiance);
  add("half_a", r.half_a);
  add("half_b", r.half_b);
  add("variance", r.variance);
  add("emission", r.emission);
  add("direct", r.direct);
  add("irradiance", r.irradiance);
  add("albedo", r.albedo);
  add("normal", r.normal, {"X", "Y", "Z"});
  file.layers["depth"] = imageFromValues(r.width, r.height, r.depth, "Z");
  return file;
}

Json summarize(const ReferenceImage& image) {
  const auto rays = static_cast<double>(image.rays.total());
  return {{"width", image.width},
          {"height", image.height},
          {"samples", image.samples},
          {"rel_error", image.rel_error},
          {"seconds", image.seconds},
          {"rays", image.rays.total()},
          {"rays_per_s", image.seconds > 0 ? Json(rays / image.seconds) : Json(nullptr)}};
}

// Provenance, cost, and the scene's exposures for HDR-FLIP, which `compare` reads.
std::map<std::string, std::string> attributesOf(const Provenance& provenance, const Json& summary,
                                                const Scene& scene, const Camera& camera) {
  std::map<std::string, std::string> attributes;
  for (const auto& [name, value] : toAttributes(provenance)) attributes[name] = value;
  for (const char* name : {"samples", "rel_error", "seconds", "rays"})
    attributes[std::string("probelab:") + name] = summary[name].dump();
  attributes["probelab:camera"] = camera.name;
  if (scene.flip) {
    attributes["probelab:flip_start"] = fmt::format("{}", scene.flip->start);
    attributes["probelab:flip_stop"] = fmt::format("{}", scene.flip->stop);
  }
  return attributes;
}

void printSummary(const Json& r) {
  fmt::print(
      "{}",
      formatFields(
          {{"size", fmt::format("{} x {}", r["width"].get<int>(), r["height"].get<int>())},
           {"samples", fmt::format("{} a pixel", r["samples"].get<int>())},
           {"relative error", formatNumber(r["rel_error"].get<double>())},
           {"time", formatDuration(r["seconds"].get<double>())},
           {"rays", fmt::format("{} million", formatNumber(r["rays"].get<double>() * 1e-6))}}));
}

void runReference(const ReferenceOptions& options, const Invocation& invocation) {
  const std::filesystem::path picture =
      std::filesystem::path(options.output).replace_extension(".png");
  checkOutput(options.output, ".exr");
  checkOutput(picture, ".png");
  const Scene scene = loadScene(options.scene, invocation);
  const Camera& camera = findCamera(scene, options.scene.camera);
  const EmbreeScene embree(scene);
  Progress progress("reference", 1, invocation.common.quiet);
  const ReferenceImage image =
      renderReference(scene, embree, camera, options.width, options.height,
                      sampleBudget(options.sampling, {.spp = kDefaultSpp}), invocation.common.seed,
                      [&](double done) { progress.update(done); });
  progress.finish();

  Json result = summarize(image);
  const Provenance provenance = makeProvenance(invocation, scene);
  ImageFile file = toImageFile(image);
  file.attributes = attributesOf(provenance, result, scene, camera);
  const Image& radiance = file.layers.at("");
  const float exposure =
      options.exposure ? static_cast<float>(*options.exposure) : suggestedExposure(radiance);
  writeExr(options.output, file);
  writePng(picture, toneMap(radiance, {.exposure_stops = exposure}));
  note(invocation, "wrote {} and {}", options.output, picture.string());
  result["output"] = options.output;
  result["picture"] = picture.string();
  result["exposure_stops"] = exposure;
  result["scene"] = scene.name;
  result["state"] = scene.state;
  result["camera"] = camera.name;
  result["provenance"] = toJson(provenance);
  reportResult(invocation, result, [&] { printSummary(result); });
}

}  // namespace

void addReferenceCommand(Program& program) {
  auto options = std::make_shared<ReferenceOptions>();
  CLI::App& app = program.addCommand(
      "reference", "path-traced image with its layers as EXR, and a PNG beside it",
      "probelab reference scenes/cornell/scene.toml -o cornell.exr --spp 1024",
      [options](const Invocation& invocation) { runReference(*options, invocation); });
  addSceneOptions(app, options->scene, true);
  addOutputOption(app, options->output, "REF.exr",
                  "linear image, layers direct, irradiance, albedo, normal, depth (metres), "
                  "variance and the two halves; the picture is REF.png",
                  true);
  app.add_option("--width", options->width, "width in pixels")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str()
      ->group("Image");
  app.add_option("--height", options->height, "height in pixels")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str()
      ->group("Image");
  app.add_option("--exposure", options->exposure,
                 "exposure of the PNG, in stops (default: automatic)")
      ->type_name("EV")
      ->check(checkFinite)
      ->group("Image");
  addSamplingOptions(app, options->sampling, "none, but --spp 256");
}

}  // namespace probelab
