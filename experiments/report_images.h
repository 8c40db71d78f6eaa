// SPDX-License-Identifier: GPL-3.0-or-later
// EXR images for the report's comparer.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "json.h"
#include "report_page.h"

namespace probelab {

struct ReportImageOptions {
  std::vector<std::string> images;  // NAME=FILE.exr
  std::string reference;            // a name; empty: "reference", else the first
  std::string layer;                // empty: the main one
  bool full_floats = false;         // else half floats, 11 bits of mantissa
};

// Sets of images of one size: [{name, width, height, precision: "half" | "float", reference: index,
// exposure: stops, images: [{name, blob, not_finite: count of pixels}]}]. One set is `folder`'s own
// EXR files and --image; each folder in it is another one. Pixels are R, G, B, [y][x][3], little
// endian. Throws InputError naming the file for sizes that differ, names that are there twice, an
// unknown reference, values that half floats cannot hold.
Json reportImages(const std::filesystem::path& folder, const ReportImageOptions& options,
                  ReportPage& page);

}  // namespace probelab
