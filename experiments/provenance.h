// SPDX-License-Identifier: GPL-3.0-or-later
// Where a result comes from: what every output file carries, so that it can be made again.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "json.h"
#include "program.h"
#include "scene/scene.h"

namespace probelab {

struct Provenance {
  std::string version, compiler, build_type;
  std::string command;  // the command line
  uint64_t seed = 0;
  int threads = 0;
  std::string scene, scene_hash, state;  // empty where no scene is involved
  std::string device, driver;            // empty where no device is involved
  std::string tracer;
};

Provenance makeProvenance(const Invocation& invocation);
Provenance makeProvenance(const Invocation& invocation, const Scene& scene);

// Members that are empty are left out.
Json toJson(const Provenance& provenance);
// The same as "probelab:<name>" -> text, for the attributes of an EXR file.
std::vector<std::pair<std::string, std::string>> toAttributes(const Provenance& provenance);

}  // namespace probelab
