// SPDX-License-Identifier: Apache-2.0
// Path-traced camera images with their layers, and the camera rays that every image uses.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "scene/scene.h"
#include "trace/embree_scene.h"
#include "trace/path_tracer.h"

namespace probelab {

// The ray through (x, y) in pixels of a width x height image, y down, (0, 0) the top-left corner;
// pixel (i, j) has its centre at (i + 0.5, j + 0.5). Square pixels.
Ray cameraRay(const Camera& camera, int width, int height, float x, float y);

// Every layer is [y][x], row 0 on top, a mean over the pixel's samples (box filter). Layers of the
// first hit are 0 where nothing was hit.
struct ReferenceImage {
  int width = 0, height = 0;
  std::vector<Vec3f> radiance;        // emission + albedo / pi (direct + irradiance), sky on a miss
  std::vector<Vec3f> half_a, half_b;  // independent halves of it; radiance = (a + b) / 2
  std::vector<Vec3f> variance;        // of `radiance`, from the variance across passes
  std::vector<Vec3f> emission;        // at the first hit; the sky on a miss
  std::vector<Vec3f> direct;          // E_delta at the first hit
  std::vector<Vec3f> irradiance;      // field irradiance at the first hit
  std::vector<Vec3f> albedo, normal;
  std::vector<float> depth;  // distance from the camera in metres
  uint32_t samples = 0;      // per pixel
  RayCount rays;
  double seconds = 0, rel_error = 0;
};

// Passes have 4 samples here, so spp is rounded up to a multiple of 8. Deterministic and throwing
// as estimateIrradiance. Throws InputError unless 1 <= width, height <= 16384.
ReferenceImage renderReference(const Scene& scene, const EmbreeScene& embree, const Camera& camera,
                               int width, int height, const SampleBudget& budget, uint64_t seed,
                               const std::function<void(double)>& progress = {});

}  // namespace probelab
