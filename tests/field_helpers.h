// SPDX-License-Identifier: GPL-3.0-or-later
// Fields over scenes made in code, for tests.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ddgi/probe_field.h"
#include "ddgi/run_field.h"
#include "gpu_fixture.h"
#include "scene_builders.h"

namespace probelab::test {

// A preset with 32-bit atlases, so that only the algorithm is tested.
inline Params exactParams(const std::string& preset) {
  Params params = loadParams(preset);
  params.irradiance_format = PL_FORMAT_RGBA32F;
  params.moment_format = PL_FORMAT_RG32F;
  return params;
}

// count points a box; all of them stored.
inline ProbeLayout boxLayout(const Box3f& box, const Vec3i& count, const Box3f& bounds) {
  const Lattice lattice = makeLattice(box, count);
  ProbeLayout layout = latticeLayout(
      lattice, bounds, std::vector<uint8_t>(static_cast<std::size_t>(lattice.pointCount()), 1));
  layout.strategy = "test";
  return layout;
}

// A scene with what refers to it.
struct FieldScene {
  explicit FieldScene(Scene s) : scene(std::move(s)), embree(scene) {}
  std::unique_ptr<ProbeField> field(GpuContext& gpu, const ProbeLayout& layout,
                                    const Params& params, FieldSettings settings = {}) const {
    return std::make_unique<ProbeField>(gpu, scene, embree, layout, params, settings);
  }
  Scene scene;
  EmbreeScene embree;
};

// A room with walls facing in from (0,0,0) to (2,2,2); all emit and reflect alike.
inline Scene furnaceScene(float albedo, float emission) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(albedo), Vec3f(emission));
  builder.box(Vec3f(0), Vec3f(2), m, true);
  return builder.finish();
}

}  // namespace probelab::test
