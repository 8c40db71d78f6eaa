// SPDX-License-Identifier: GPL-3.0-or-later
#include "field_dump.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/files.h"
#include "image/exr.h"
#include "image/image.h"

namespace probelab {
namespace {

ImageFile withAttributes(Image image, const ProbeField& field, const Provenance& provenance) {
  ImageFile file;
  for (const auto& [name, value] : toAttributes(provenance)) file.attributes[name] = value;
  file.attributes["probelab:params"] = field.params().name;
  file.attributes["probelab:support_radius_m"] = fmt::format("{}", field.layout().support_radius_m);
  file.layers[""] = std::move(image);
  return file;
}

}  // namespace

void checkDumpFolder(const std::filesystem::path& folder) {
  std::error_code ec;
  if (!std::filesystem::is_directory(folder, ec))
    throwInput("--dump-field {}: no such folder; create it first", folder.string());
  checkWritable(folder / "irradiance.exr");
}

void dumpField(const std::filesystem::path& folder, const Scene& scene, ProbeField& field,
               const Provenance& provenance) {
  const auto probes = static_cast<int>(field.probeCount());
  const int side_i = field.params().irradiance_texels;
  std::vector<Vec3f> irradiance = field.irradianceTexels();
  const auto gamma = static_cast<float>(field.params().encoding_gamma);
  for (Vec3f& texel : irradiance)
    for (std::size_t c = 0; c < 3; ++c)
      texel[c] = std::pow(texel[c], gamma) * std::numbers::pi_v<float>;
  writeExr(folder / "irradiance.exr",
           withAttributes(imageFromPixels(side_i, side_i * probes, irradiance), field, provenance));

  const std::vector<Vec2f> moments = field.momentTexels();
  if (!moments.empty()) {
    const int side_m = field.params().moment_texels;
    Image image = makeImage(side_m, side_m * probes, {"X", "Y"});
    for (std::size_t i = 0; i < moments.size(); ++i) {
      image.data[2 * i] = moments[i].x;
      image.data[2 * i + 1] = moments[i].y;
    }
    writeExr(folder / "moments.exr", withAttributes(std::move(image), field, provenance));
  }
  std::string positions = "index,x,y,z\n";
  for (std::size_t i = 0; i < field.layout().positions.size(); ++i) {
    const Vec3d p = toWorld(scene, field.layout().positions[i]);
    positions += fmt::format("{},{},{},{}\n", i, p.x, p.y, p.z);
  }
  writeTextFile(folder / "probes.csv", positions);
  writeTextFile(folder / "params.toml", describeParams(field.params()));
}

}  // namespace probelab
