// SPDX-License-Identifier: GPL-3.0-or-later
// Receivers of room.glb with their truth.
#include "fuzz.h"
#include "trace/receivers.h"

void probelab::fuzz::runReceiversJson(Bytes bytes) {
  expectLoadedOrRefused([&] { readReceivers(inputFile(bytes, "input.json"), room()); });
}
