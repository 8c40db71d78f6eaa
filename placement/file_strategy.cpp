// SPDX-License-Identifier: GPL-3.0-or-later
// `file`: probes that a person placed or edited, or a layout that was made before.
#include <algorithm>
#include <filesystem>
#include <string>

#include "base/error.h"
#include "ddgi/layout_file.h"
#include "placement/random_layouts.h"
#include "placement/scattered.h"
#include "probe_files.h"

namespace probelab {
namespace {

std::string extensionOf(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

void checkProbes(const PlacementInput& input, const std::string& path,
                 const std::vector<Vec3f>& positions) {
  if (positions.empty())
    throwInput(
        "{}: no probes in it: nodes named 'probe ...', meshes of POINTS or lines of x,y,z are read",
        path);
  if (positions.size() > static_cast<std::size_t>(input.probes))
    throwInput("{}: {} probes, the budget is {}; remove some or give --probes {}", path,
               positions.size(), input.probes, positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Vec3d world = toWorld(input.scene, positions[i]);
    if (isUsable(input, positions[i])) continue;
    if (input.scene.bounds.contains(positions[i]) &&
        isInsideSolid(input.scene, input.embree, positions[i]))
      throwInput("{}: probe {} at ({:g}, {:g}, {:g}) lies inside solid geometry; move it out", path,
                 i, world.x, world.y, world.z);
    throwInput(
        "{}: probe {} at ({:g}, {:g}, {:g}) lies outside the volume or where no camera or "
        "receiver seed reaches; move it",
        path, i, world.x, world.y, world.z);
  }
}

ProbeLayout placeFile(const PlacementInput& input) {
  const std::string& path = input.options.at("path");
  if (path.empty()) throwInput("strategy 'file': --option path=FILE is needed");
  std::error_code ec;
  if (std::filesystem::exists(path, ec) && !std::filesystem::is_regular_file(path, ec))
    throwInput("{}: is no regular file", path);
  const std::string extension = extensionOf(path);
  if (extension == ".json") {
    for (const StrategyOption& option : scatteredOptions())
      if (input.given.contains(option.name))
        throwInput("--option {}: {} is a layout and brings its own weights", option.name, path);
    ProbeLayout layout = readLayout(path, input.scene);
    checkProbes(input, path, layout.positions);
    layout.options = {{"path", path}};
    return layout;
  }
  FilePoints points;
  if (extension == ".csv")
    points = readCsvPoints(path);
  else if (extension == ".glb" || extension == ".gltf")
    points = readGltfPoints(path);
  else
    throwInput("{}: probes are read from .glb, .gltf, .csv and layout .json files", path);
  std::vector<Vec3f> positions;
  for (const Vec3d& p : points.world) positions.push_back(toLocal(input.scene, p));
  checkProbes(input, path, positions);
  if (std::ranges::none_of(points.pinned, [](uint8_t p) { return p != 0; })) points.pinned.clear();
  return scatterProbes(FreeSpace(input), std::move(positions), std::move(points.pinned));
}

}  // namespace

const Strategy kFileStrategy = {
    "file",
    "probes from a file: GLB or glTF (nodes named 'probe ...', meshes of POINTS), CSV, layout JSON",
    scatteredOptions({{"path", "", "FILE", "x,y,z[,pinned] a line in a CSV, world coordinates"}}),
    placeFile};

}  // namespace probelab
