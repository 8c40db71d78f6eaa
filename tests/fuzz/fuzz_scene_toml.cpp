// SPDX-License-Identifier: GPL-3.0-or-later
// A scene's TOML, beside a glTF and a sky that it may name.
#include "fuzz.h"
#include "scene/load.h"

void probelab::fuzz::runSceneToml(Bytes bytes) {
  expectLoadedOrRefused([&] { loadScene(inputFile(bytes, "input.toml")); });
}
