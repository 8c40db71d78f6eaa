// SPDX-License-Identifier: GPL-3.0-or-later
// Fields over scenes made in code, for tests.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ddgi/directions.h"
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

// Radiance as a test wants it: one probe under a sky a (1 + b d.z), one ray an update, so that all
// texels see what that ray sees. Rotation numbers choose the radiance, in [a (1 - b), a (1 + b)].
class ControlledSky {
 public:
  ControlledSky(const Vec3f& a, float b) : a_(a), b_(b), scene_(skyScene(a, b)) {}

  std::unique_ptr<ProbeField> field(GpuContext& gpu, Params params) const {
    params.rays = 1;
    return scene_.field(gpu, boxLayout(scene_.scene.bounds, Vec3i(1), scene_.scene.bounds), params,
                        {.accumulate = false});
  }
  // What the ray of an update brings.
  Vec3d radiance(uint64_t rotation) const {
    const double height = static_cast<double>(updateDirections(1, 0, rotation).front().z);
    return Vec3d(a_) * (1 + static_cast<double>(b_) * height);
  }
  // The rotation, of the first few thousand, whose radiance is nearest to share x a.
  uint64_t rotationFor(double share) const {
    uint64_t best = 0;
    const auto error = [&](uint64_t rotation) {
      return std::abs(radiance(rotation).x - share * static_cast<double>(a_.x));
    };
    for (uint64_t rotation = 1; rotation < 4000; ++rotation)
      if (error(rotation) < error(best)) best = rotation;
    return best;
  }

 private:
  static Scene skyScene(const Vec3f& a, float b) {
    SceneBuilder builder;
    builder.scene().sky.radiance = a;
    builder.scene().sky.linear = Vec3f(0, 0, b);
    builder.scene().bounds = {Vec3f(-1), Vec3f(1)};
    return builder.finish();
  }
  Vec3f a_;
  float b_;
  FieldScene scene_;
};

}  // namespace probelab::test
