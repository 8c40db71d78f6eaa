// SPDX-License-Identifier: GPL-3.0-or-later
#include "report_images.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/suggest.h"
#include "image/exr.h"
#include "image/tonemap.h"
#include "report_studies.h"
#include "shared/atlas_format.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

struct NamedFile {
  std::string name;
  fs::path path;
};

constexpr float kLargestHalf = 65504.0f;

uint16_t halfBits(float value, const fs::path& path) {
  if (std::isnan(value)) return 0x7e00;
  if (std::isinf(value)) return value > 0 ? 0x7c00 : 0xfc00;
  if (std::abs(value) > kLargestHalf)
    throwInput("{}: a value of {:g} is too large for half floats; add --precision float",
               path.string(), value);
  return static_cast<uint16_t>(packHalfFloat(value, kRoundToNearest));
}

void appendBytes(std::vector<std::byte>& bytes, uint32_t value, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i)
    bytes.push_back(static_cast<std::byte>(value >> (8 * i) & 0xff));
}

std::vector<std::byte> pixelBytes(const std::vector<Vec3f>& pixels, bool full_floats,
                                  const fs::path& path) {
  std::vector<std::byte> bytes;
  bytes.reserve(pixels.size() * (full_floats ? 12 : 6));
  for (const Vec3f& p : pixels)
    for (const float value : {p.x, p.y, p.z}) {
      if (full_floats)
        appendBytes(bytes, std::bit_cast<uint32_t>(value), 4);
      else
        appendBytes(bytes, halfBits(value, path), 2);
    }
  return bytes;
}

class ImageSet {
 public:
  ImageSet(std::string name, const ReportImageOptions& options, ReportPage& page)
      : name_(std::move(name)), options_(options), page_(page) {}

  void add(const NamedFile& file) {
    const ImageFile content = readExr(file.path);
    const Image& image = layerOf(content, options_.layer, file.path.string());
    if (images_.empty()) width_ = image.width, height_ = image.height, first_ = file;
    if (image.width != width_ || image.height != height_)
      throwInput(
          "{}: is {} x {}, but {} is {} x {}; images that are compared must have one size, "
          "others belong into a folder of their own in 'images'",
          file.path.string(), image.width, image.height, first_.path.string(), width_, height_);
    const std::vector<Vec3f> pixels = pixelsOf(image);
    const auto bad = std::ranges::count_if(pixels, [](const Vec3f& p) { return !isFinite(p); });
    names_.push_back(file.name);
    exposures_.push_back(bad == 0 ? suggestedExposure(image) : 0);
    images_.push_back({{"name", file.name},
                       {"blob", page_.addBlob(pixelBytes(pixels, options_.full_floats, file.path),
                                              file.path.string())},
                       {"not_finite", bad}});
  }

  bool has(const std::string& image) const {
    return std::find(names_.begin(), names_.end(), image) != names_.end();
  }
  const std::vector<std::string>& names() const { return names_; }

  Json json() const {
    const std::string wanted = has(options_.reference) ? options_.reference : "reference";
    const auto found = std::find(names_.begin(), names_.end(), wanted);
    const std::size_t reference =
        found == names_.end() ? 0 : static_cast<std::size_t>(found - names_.begin());
    // To a quarter of a stop, as the page's control has it.
    const double exposure = std::round(static_cast<double>(exposures_[reference]) * 4) / 4;
    return {{"name", name_},          {"width", width_},
            {"height", height_},      {"precision", options_.full_floats ? "float" : "half"},
            {"reference", reference}, {"exposure", std::clamp(exposure, -10.0, 10.0)},
            {"images", images_}};
  }

 private:
  std::string name_;
  const ReportImageOptions& options_;
  ReportPage& page_;
  NamedFile first_;
  int width_ = 0, height_ = 0;
  std::vector<std::string> names_;
  std::vector<float> exposures_;
  Json images_ = Json::array();
};

NamedFile parseImage(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == 0 || equals == std::string::npos || equals + 1 == text.size())
    throwInput("--image {}: must be NAME=FILE.exr", text);
  return {text.substr(0, equals), text.substr(equals + 1)};
}

std::vector<NamedFile> filesOf(const fs::path& folder) {
  std::vector<NamedFile> files;
  for (const fs::path& path : filesIn(folder, {".exr"}))
    files.push_back({path.stem().string(), path});
  return files;
}

}  // namespace

Json reportImages(const fs::path& folder, const ReportImageOptions& options, ReportPage& page) {
  std::vector<std::pair<std::string, std::vector<NamedFile>>> wanted = {{"images", {}}};
  for (const std::string& text : options.images) wanted[0].second.push_back(parseImage(text));
  for (NamedFile& file : filesOf(folder)) wanted[0].second.push_back(std::move(file));
  for (const fs::path& inner : foldersIn(folder))
    wanted.emplace_back(inner.filename().string(), filesOf(inner));

  Json sets = Json::array();
  std::vector<std::string> known;
  for (const auto& [name, files] : wanted) {
    ImageSet set(name, options, page);
    for (const NamedFile& file : files) {
      if (set.has(file.name))
        throwInput("{}: there is another image '{}'; name one of them with --image NAME=FILE.exr",
                   file.path.string(), file.name);
      set.add(file);
    }
    if (files.empty()) continue;
    known.insert(known.end(), set.names().begin(), set.names().end());
    sets.push_back(set.json());
  }
  const bool found = std::find(known.begin(), known.end(), options.reference) != known.end();
  if (!options.reference.empty() && !found)
    throwInput(
        "--reference {}: there is no such image{}", options.reference,
        known.empty() ? "; add --image NAME=FILE.exr" : suggestion(options.reference, known));
  return sets;
}

}  // namespace probelab
