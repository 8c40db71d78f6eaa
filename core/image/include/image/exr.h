// SPDX-License-Identifier: Apache-2.0
// OpenEXR files: single-part, scan lines or tiles, any pixel type on reading; 32-bit float with ZIP
// compression on writing. The same content gives the same bytes.
#pragma once

#include <filesystem>

#include "image/image.h"

namespace probelab {

// Throws InputError naming the file when it is missing, damaged, deep, multi-part, subsampled or
// larger than 2 GiB of pixels. Memory grows with what is decoded, never with what a header claims.
// Attributes: those of type string. Channels come as R, G, B, A first, then by name.
ImageFile readExr(const std::filesystem::path& path);

// Writes by renaming a finished temporary file. Layers must have one size and at least one channel;
// attribute names must not be EXR's own.
void writeExr(const std::filesystem::path& path, const ImageFile& file);

}  // namespace probelab
