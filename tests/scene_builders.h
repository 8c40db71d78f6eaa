// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes made in code for tests.
#pragma once

#include <functional>

#include "scene/scene_builder.h"

namespace probelab::test {

using probelab::SceneBuilder;

// n x n quads over (u, v) in the unit square, without shared vertices; front where du x dv points.
inline void addSheet(SceneBuilder& builder, int n, uint32_t material,
                     const std::function<Vec3f(float, float)>& at) {
  const auto p = [&](int i, int j) {
    return at(static_cast<float>(i) / static_cast<float>(n),
              static_cast<float>(j) / static_cast<float>(n));
  };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      builder.quad(p(i, j), p(i + 1, j), p(i + 1, j + 1), p(i, j + 1), material);
}

}  // namespace probelab::test
