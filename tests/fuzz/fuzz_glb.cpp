// SPDX-License-Identifier: GPL-3.0-or-later
// A glTF in its binary form.
#include "fuzz.h"
#include "scene/load.h"

void probelab::fuzz::runGlb(Bytes bytes) {
  expectLoadedOrRefused([&] { loadScene(inputFile(bytes, "input.glb")); });
}
