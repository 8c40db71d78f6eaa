// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes made in code for tests.
#pragma once

#include "scene/scene_builder.h"

namespace probelab::test {

using probelab::SceneBuilder;

}  // namespace probelab::test
