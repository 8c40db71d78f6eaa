// SPDX-License-Identifier: GPL-3.0-or-later
// A layout for room.glb.
#include "ddgi/layout_file.h"
#include "fuzz.h"

void probelab::fuzz::runLayoutJson(Bytes bytes) {
  expectLoadedOrRefused([&] { readLayout(inputFile(bytes, "input.json"), room()); });
}
