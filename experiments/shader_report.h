// SPDX-License-Identifier: GPL-3.0-or-later
// What the specialised shaders of a scene and parameters contain, and what they do without.
#pragma once

#include <string>

#include "ddgi/params.h"
#include "json.h"
#include "scene/scene.h"

namespace probelab {

// {"params", "parts": {name: whether it is compiled in}, "absent_buffers": [names], "stages":
// [{stage, words, full_words}]}: words of SPIR-V, and of the same stage with every part in it. Of
// the stages whose code depends on the scene or the parameters; those that do not run are left out.
Json shaderReport(const Scene& scene, const Params& params);

std::string formatShaders(const Json& report);

}  // namespace probelab
