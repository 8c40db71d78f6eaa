// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab render`: a camera image lit by a probe field, optionally against a reference image.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/progress.h"
#include "commands.h"
#include "compare_images.h"
#include "ddgi/render.h"
#include "device.h"
#include "evaluation.h"
#include "field_setup.h"
#include "image/exr.h"
#include "image/png.h"
#include "image/tonemap.h"
#include "require.h"
#include "table.h"
#include "traced_shading.h"

namespace probelab {
namespace {

struct RenderOptions {
  SceneOptions scene;
  FieldOptions field;
  std::string output, compare;
  int width = 640, height = 360, spp = 16;
  std::optional<double> exposure;
  bool show_probes = false, traced_visibility = false;
};

constexpr float kBallRadius = 0.1f;  // of a probe's bias length

std::map<std::string, std::string> attributesOf(const FieldSetup& setup, const Camera& camera,
                                                const FieldRun& run, const RenderOptions& options) {
  std::map<std::string, std::string> attributes;
  for (const auto& [name, value] : toAttributes(setup.provenance)) attributes[name] = value;
  attributes["probelab:camera"] = camera.name;
  attributes["probelab:samples"] = std::to_string(options.spp);
  if (options.traced_visibility) attributes["probelab:visibility"] = "traced";
  attributes["probelab:params"] = setup.params.name;
  attributes["probelab:strategy"] = setup.field->layout().strategy;
  attributes["probelab:probes"] = std::to_string(setup.field->probeCount());
  attributes["probelab:updates"] = std::to_string(run.updates);
  return attributes;
}

ImageFile toImageFile(const FieldImage& image) {
  ImageFile file;
  file.layers[""] = imageFromPixels(image.width, image.height, image.radiance);
  file.layers["irradiance"] = imageFromPixels(image.width, image.height, image.irradiance);
  file.layers["depth"] = imageFromValues(image.width, image.height, image.depth, "Z");
  return file;
}

ShadeRays shadingOf(const RenderOptions& options, FieldSetup& setup, FieldCamera& view) {
  if (!options.traced_visibility)
    return [&view](std::span<const Ray> rays) { return view.shade(rays); };
  return [&setup, &view, field = takeSnapshot(*setup.field),
          materials = makeMaterialTable(setup.scene)](std::span<const Ray> rays) {
    ShadedRays shaded = view.shade(rays);
    replaceVisibility(rays, field, setup.params, setup.scene, setup.embree, materials, shaded);
    return shaded;
  };
}

FieldImage renderImage(const RenderOptions& options, FieldSetup& setup, const Camera& camera,
                       const Invocation& invocation) {
  Progress progress("image", 1, invocation.common.quiet);
  FieldCamera view(setup.gpu, *setup.field, setup.scene, setup.embree);
  FieldImage image =
      renderField(shadingOf(options, setup, view), camera, options.width, options.height,
                  options.spp, invocation.common.seed, [&](double done) { progress.update(done); });
  progress.finish();
  if (options.show_probes)
    drawProbes(image, *setup.field, camera, kBallRadius * setup.field->layout().bias_length_m);
  return image;
}

// The reference, or nothing: read before the work starts, so that a bad one is refused at once.
std::optional<LoadedImage> loadReference(const RenderOptions& options) {
  if (options.compare.empty()) return std::nullopt;
  LoadedImage reference{options.compare, readExr(options.compare), ""};
  const Image& image = reference.image();
  if (image.width != options.width || image.height != options.height)
    throwInput("{}: is {} x {} pixels; add --width {} --height {}", options.compare, image.width,
               image.height, image.width, image.height);
  return reference;
}

void runRender(const RenderOptions& options, const Invocation& invocation) {
  const std::filesystem::path picture =
      std::filesystem::path(options.output).replace_extension(".png");
  checkOutput(options.output, ".exr");
  checkOutput(picture, ".png");
  const std::optional<LoadedImage> reference = loadReference(options);
  FieldSetup setup(options.scene, options.field, invocation);
  const Camera& camera = findCamera(setup.scene, options.scene.camera);
  const FieldRun run = runField(*setup.field, options.field, invocation);
  LoadedImage image{options.output, toImageFile(renderImage(options, setup, camera, invocation)),
                    ""};
  requireNoValidationMessages(setup.gpu);
  image.file.attributes = attributesOf(setup, camera, run, options);

  Json result = {{"output", options.output},
                 {"picture", picture.string()},
                 {"scene", setup.scene.name},
                 {"state", setup.scene.state},
                 {"camera", camera.name},
                 {"width", options.width},
                 {"height", options.height},
                 {"samples", options.spp},
                 {"params", setup.params.name},
                 {"traced_visibility", options.traced_visibility},
                 {"strategy", setup.field->layout().strategy},
                 {"probes", setup.field->probeCount()},
                 {"active_probes", setup.field->states().activeCount()},
                 {"updates", run.updates},
                 {"stopped_early", run.stopped_early},
                 {"memory", memoryJson(*setup.field)},
                 {"state_ms", setup.field->stateStages()},
                 {"ray_proxy", proxyJson(setup.proxy.get())},
                 {"values", toJson(run.values)},
                 {"comparison", nullptr}};
  if (reference) result["comparison"] = compareImages(image, *reference, {});
  const Image& radiance = reference ? reference->image() : image.image();
  const float exposure =
      options.exposure ? static_cast<float>(*options.exposure) : suggestedExposure(radiance);
  result["exposure_stops"] = exposure;
  result["provenance"] = toJson(setup.provenance);
  writeExr(options.output, image.file);
  writePng(picture, toneMap(image.image(), {.exposure_stops = exposure}));
  note(invocation, "wrote {} and {}", options.output, picture.string());
  reportResult(invocation, result, [&] {
    fmt::print(
        "{}",
        formatFields({{"probes", fmt::format("{} stored, {} active", setup.field->probeCount(),
                                             setup.field->states().activeCount())},
                      {"memory",
                       fmt::format("{} bytes of texels a probe", atlasBytesPerProbe(setup.params))},
                      {"parameters", setup.params.name},
                      {"visibility", options.traced_visibility ? "traced" : "of the parameters"},
                      {"updates", fmt::format("{}{}", run.updates,
                                              run.stopped_early ? ", stopped early" : "")}}));
    if (setup.proxy)
      fmt::print("{}", formatFields({{"ray proxy", formatProxy(result["ray_proxy"])}}));
    if (run.values) fmt::print("{}", formatFields({{"values", formatValues(result["values"])}}));
    if (reference) fmt::print("\n{}", formatImageErrors(result["comparison"]));
  });
}

}  // namespace

void addRenderCommand(Program& program) {
  auto options = std::make_shared<RenderOptions>();
  CLI::App& app = program.addCommand(
      "render", "camera image lit by a probe field, as EXR with a PNG beside it",
      "probelab render scenes/cornell/scene.toml -o ddgi.exr --compare cornell.exr",
      [options](const Invocation& invocation) { runRender(*options, invocation); });
  addSceneOptions(app, options->scene, true);
  addOutputOption(app, options->output, "OUT.exr",
                  "linear image with the layers irradiance and depth (metres); the picture is "
                  "OUT.png",
                  true);
  app.add_option("--compare", options->compare,
                 "a reference image of the same size to measure against")
      ->type_name("REF.exr")
      ->group("Output");
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
  app.add_option("--spp", options->spp, "samples a pixel")
      ->type_name("N")
      ->check(checkPositiveInteger)
      ->capture_default_str()
      ->group("Image");
  app.add_option("--exposure", options->exposure,
                 "exposure of the PNG, in stops (default: automatic, from the reference if there "
                 "is one)")
      ->type_name("EV")
      ->check(checkFinite)
      ->group("Image");
  app.add_flag("--traced-visibility", options->traced_visibility,
               "answer for the camera with rays to the probes in place of their moments, on the "
               "CPU: what no visibility test can beat (bounces keep the moments')")
      ->group("Image");
  app.add_flag("--show-probes", options->show_probes,
               "draw the probes as balls of their irradiance")
      ->group("Image");
  addFieldOptions(app, options->field);
  addValuesOption(app, options->field);
}

}  // namespace probelab
