// SPDX-License-Identifier: Apache-2.0
// 8-bit RGB PNG files, marked as sRGB.
#pragma once

#include <filesystem>

#include "image/image.h"

namespace probelab {

// Writes by renaming a finished temporary file.
void writePng(const std::filesystem::path& path, const ByteImage& image);

// Any PNG, converted to 8-bit sRGB over black. Throws InputError naming the file when it is
// missing, damaged or larger than 2^26 pixels.
ByteImage readPng(const std::filesystem::path& path);

}  // namespace probelab
