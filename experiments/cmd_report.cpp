// SPDX-License-Identifier: GPL-3.0-or-later
// `probelab report`: one HTML file to explore results in, without a network.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/build_info.h"
#include "base/error.h"
#include "base/files.h"
#include "commands.h"
#include "ddgi/layout_file.h"
#include "ddgi/probe_field.h"
#include "device.h"
#include "field_options.h"
#include "report_figures.h"
#include "report_images.h"
#include "report_layout.h"
#include "report_page.h"
#include "report_studies.h"
#include "require.h"
#include "scene_options.h"
#include "table.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

struct ReportOptions {
  std::string folder, output, precision = "half";
  ReportImageOptions images;
  std::string layout, probe_values;
  SceneOptions scene;
  FieldOptions field;
  CLI::Option* params = nullptr;  // to tell whether it was given
  double max_mib = 64;
};

fs::path outputPath(const ReportOptions& options) {
  return options.output.empty() ? fs::path(options.folder) / "report.html"
                                : fs::path(options.output);
}

void checkOptions(const ReportOptions& options) {
  std::error_code ec;
  if (!fs::is_directory(options.folder, ec))
    throwInput("{}: is no folder; name one with results, as 'probelab run' writes them",
               options.folder);
  if (options.layout.empty() != options.scene.scene.empty())
    throwInput("--layout and --scene belong together; add {}",
               options.layout.empty() ? "--layout LAYOUT.json" : "--scene SCENE");
  for (const auto& [flag, given] : {std::pair{"--probe-values", !options.probe_values.empty()},
                                    std::pair{"--params", options.params->count() > 0}})
    if (given && options.layout.empty())
      throwInput("{} is for the 3D view; add --layout LAYOUT.json --scene SCENE", flag);
  checkOutput(outputPath(options), ".html");
}

// As --params relocates and classifies the probes; without it, as the layout has them.
ProbeStates settledStates(const ReportOptions& options, const ProbeLayout& layout,
                          const Scene& scene, const EmbreeScene& embree,
                          const Invocation& invocation) {
  if (options.params->count() == 0) return initialStates(layout);
  const Params params = resolveParams(options.field);
  validateLayout(layout, params);
  if (params.classification == 0 && params.relocation == 0)
    throwInput("--params {}: neither moves probes nor switches any off; leave it out",
               options.field.params);
  Provenance provenance;
  GpuContext gpu = openDevice(invocation, provenance);
  const ProbeField field(gpu, scene, embree, layout, params,
                         {.seed = invocation.common.seed, .accumulate = false});
  requireNoValidationMessages(gpu);
  return field.states();
}

Json layoutView(const ReportOptions& options, const Invocation& invocation, ReportPage& page) {
  if (options.layout.empty()) return nullptr;
  const Scene scene = loadScene(options.scene, invocation);
  const ProbeLayout layout = readLayout(options.layout, scene);
  const EmbreeScene embree(scene);
  const std::string params = options.params->count() > 0 ? options.field.params : "";
  Json view = reportLayout(
      {scene, embree, layout, settledStates(options, layout, scene, embree, invocation), params,
       options.probe_values},
      page);
  if (view["triangles"]["shown"] != view["triangles"]["all"])
    note(invocation, "{}: the page shows the {} largest of {} triangles", scene.path,
         view["triangles"]["shown"].dump(), view["triangles"]["all"].dump());
  return view;
}

// DIR/figures, and those of each study in DIR.
Json allFigures(const fs::path& folder, ReportPage& page, const Invocation& invocation) {
  Json figures = reportFigures(folder / "figures", page, invocation);
  for (const fs::path& inner : foldersIn(folder))
    for (Json& figure : reportFigures(inner / "figures", page, invocation)) {
      figure["name"] = inner.filename().string() + "/" + figure["name"].get<std::string>();
      figures.push_back(std::move(figure));
    }
  return figures;
}

std::size_t countRows(const Json& studies, const char* list) {
  std::size_t count = 0;
  for (const Json& study : studies) count += study[list].size();
  return count;
}

Json resultJson(const fs::path& output, const Json& data, std::size_t bytes) {
  std::size_t images = 0;
  for (const Json& set : data["image_sets"]) images += set["images"].size();
  return {{"output", output.string()},
          {"bytes", bytes},
          {"studies", data["studies"].size()},
          {"rows", countRows(data["studies"], "rows")},
          {"failures", countRows(data["studies"], "failures")},
          {"figures", data["figures"].size()},
          {"images", images},
          {"probes", data["layout"].is_null() ? Json(0) : data["layout"]["probes"]["count"]},
          {"version", buildInfo().version}};
}

void printResult(const Json& r) {
  fmt::print(
      "{}",
      formatFields({{"page", r["output"].get<std::string>()},
                    {"size", formatBytes(r["bytes"].get<double>())},
                    {"tables", fmt::format("{} studies, {} rows, {} failures", r["studies"].dump(),
                                           r["rows"].dump(), r["failures"].dump())},
                    {"figures", r["figures"].dump()},
                    {"images", r["images"].dump()},
                    {"probes in 3D", r["probes"].dump()}}));
}

void runReport(ReportOptions& options, const Invocation& invocation) {
  checkOptions(options);
  options.images.full_floats = options.precision == "float";
  const fs::path folder = options.folder;
  ReportPage page(static_cast<uint64_t>(std::llround(options.max_mib * 1024 * 1024)));
  // A folder's name, also for "." and "results/".
  fs::path named = plainPath(folder);
  if (!named.has_filename()) named = named.parent_path();
  Json data = {{"title", named.filename().string()}, {"version", buildInfo().version}};
  data["studies"] = reportStudies(folder);
  data["figures"] = allFigures(folder, page, invocation);
  data["image_sets"] = reportImages(folder / "images", options.images, page);
  if (!options.images.layer.empty() && data["image_sets"].empty())
    throwInput("--layer {}: there are no images; add --image NAME=FILE.exr", options.images.layer);
  data["layout"] = layoutView(options, invocation, page);
  if (data["studies"].empty() && data["figures"].empty() && data["image_sets"].empty() &&
      data["layout"].is_null())
    throwInput(
        "{}: holds no study (cells/*.json), no figures/*.png and no images/*.exr; name the "
        "--results of 'probelab run', or add --image or --layout",
        options.folder);
  data["embedded_bytes"] = page.blobBytes();
  const fs::path output = outputPath(options);
  const std::string html = page.html(data["title"].get<std::string>(), data);
  writeTextFile(output, html);
  const Json result = resultJson(output, data, html.size());
  reportResult(invocation, result, [&] { printResult(result); });
}

void addImageOptions(CLI::App& app, ReportOptions& options) {
  const char* group = "Images";
  app.add_option("--image", options.images.images,
                 "an image to compare, besides DIR/images/*.exr; may be repeated; all have one "
                 "size (images of other views: a folder each in DIR/images)")
      ->type_name("NAME=FILE.exr")
      ->allow_extra_args(false)
      ->group(group);
  app.add_option("--reference", options.images.reference,
                 "the image that errors are taken against (default: 'reference', else the first)")
      ->type_name("NAME")
      ->group(group);
  app.add_option("--layer", options.images.layer,
                 "layer of all images, such as irradiance (default: the main one)")
      ->type_name("NAME")
      ->group(group);
  app.add_option("--precision", options.precision,
                 "half (6 bytes a pixel, values to 1 in 2,048) or float (12 bytes, exact)")
      ->type_name("NAME")
      ->check(CLI::IsMember({"half", "float"}).description(""))
      ->capture_default_str()
      ->group(group);
}

void addLayoutOptions(CLI::App& app, ReportOptions& options) {
  const char* group = "3D view";
  app.add_option("--layout", options.layout, "a layout, as 'probelab place' writes")
      ->type_name("LAYOUT.json")
      ->group(group);
  app.add_option("--scene", options.scene.scene,
                 fmt::format("the layout's scene; of more than {} triangles the largest are shown, "
                             "and the page says so",
                             kMostTriangles))
      ->type_name("SCENE")
      ->group(group);
  app.add_option("--probe-values", options.probe_values,
                 "numbers to colour probes by: a line with names, then one a probe, its index in "
                 "the column 'probe'")
      ->type_name("FILE.csv")
      ->group(group);
  options.params =
      app.add_option("--params", options.field.params,
                     "a preset or TOML file that relocates probes or switches them off; needs a "
                     "Vulkan device (default: probes are as the layout has them)")
          ->type_name("PRESET|FILE")
          ->group(group);
}

}  // namespace

void addReportCommand(Program& program) {
  auto options = std::make_shared<ReportOptions>();
  CLI::App& app = program.addCommand(
      "report", "one HTML file with tables, figures, images and a 3D view, to open from disk",
      "probelab report results/runs/error_vs_n --layout l.json --scene s.toml",
      [options](const Invocation& invocation) { runReport(*options, invocation); });
  app.add_option("DIR", options->folder,
                 "a study's results (cells, figures, images), or a folder of several such folders")
      ->required();
  addOutputOption(app, options->output, "FILE.html", "the page (default: DIR/report.html)", false);
  app.add_option("--max-mib", options->max_mib,
                 "refuse to write a page with more embedded data than this; nothing is ever made "
                 "smaller to fit")
      ->type_name("MIB")
      ->check(checkPositive)
      ->capture_default_str()
      ->group("Output");
  addImageOptions(app, *options);
  addLayoutOptions(app, *options);
}

}  // namespace probelab
