// SPDX-License-Identifier: GPL-3.0-or-later
// Points of --points in room.glb.
#include "fuzz.h"
#include "trace/reachability.h"
#include "trace/receivers.h"

void probelab::fuzz::runPointsCsv(Bytes bytes) {
  static const EmbreeScene kEmbree(room());
  static const Reachability kReachable = findReachable(room(), kEmbree);
  expectLoadedOrRefused(
      [&] { readReceiverPoints(inputFile(bytes, "input.csv"), room(), kEmbree, kReachable); });
}
