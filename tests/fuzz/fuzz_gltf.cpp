// SPDX-License-Identifier: GPL-3.0-or-later
// A glTF as JSON; its buffers and images may be data URIs or the files of the harness's folder.
#include "fuzz.h"
#include "scene/load.h"

void probelab::fuzz::runGltf(Bytes bytes) {
  expectLoadedOrRefused([&] { loadScene(inputFile(bytes, "input.gltf")); });
}
