// SPDX-License-Identifier: GPL-3.0-or-later
// An EXR, by both readers: that of images and that of skies.
#include "fuzz.h"
#include "image/exr.h"
#include "sky_image.h"

void probelab::fuzz::runExr(Bytes bytes) {
  const std::filesystem::path path = inputFile(bytes, "input.exr");
  expectLoadedOrRefused([&] { readExr(path); });
  expectLoadedOrRefused([&] {
    Sky sky;
    std::vector<std::string> hashes;
    readSkyImage(path, sky, hashes);
  });
}
