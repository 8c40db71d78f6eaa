// SPDX-License-Identifier: Apache-2.0
// Camera images lit by a field: primary rays go through the same tracer and stages as probe rays.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "ddgi/field_camera.h"
#include "scene/scene.h"

namespace probelab {

struct FieldImage {
  int width = 0, height = 0;
  std::vector<Vec3f> radiance;    // [y][x], mean over the pixel's samples
  std::vector<Vec3f> irradiance;  // the field's answer at the first hit, 0 on a miss
  std::vector<float> depth;       // metres, 0 on a miss
};

// What camera rays bring, as FieldCamera::shade says.
using ShadeRays = std::function<ShadedRays(std::span<const Ray>)>;

// `spp` jittered samples a pixel, a function of (seed, pixel, sample). Throws NumericalError naming
// the pixel where a value is not finite, InputError unless 1 <= width, height <= 16384.
FieldImage renderField(const ShadeRays& shade, const Camera& camera, int width, int height, int spp,
                       uint64_t seed, const std::function<void(double)>& progress = {});

// Draws probes as shaded balls over an image: where `depth` lets them be seen, coloured by the
// irradiance that their texel facing the camera stores. `radius_m` is the balls' radius.
void drawProbes(FieldImage& image, ProbeField& field, const Camera& camera, float radius_m);

}  // namespace probelab
