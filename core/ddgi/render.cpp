// SPDX-License-Identifier: Apache-2.0
#include "ddgi/render.h"

#include <cmath>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/parallel.h"
#include "base/rng.h"
#include "ddgi/snapshot.h"
#include "trace/reference_image.h"

namespace probelab {
namespace {

std::vector<Ray> pixelRays(const Camera& camera, const FieldImage& image, int sample,
                           uint64_t seed) {
  const auto width = static_cast<std::size_t>(image.width);
  std::vector<Ray> rays(image.radiance.size());
  parallelFor(rays.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Rng rng(seed, RngStream::field_image, i, static_cast<uint64_t>(sample));
      const float x = static_cast<float>(i % width) + rng.nextFloat();
      const float y = static_cast<float>(i / width) + rng.nextFloat();
      rays[i] = cameraRay(camera, image.width, image.height, x, y);
    }
  });
  return rays;
}

void checkFinite(const FieldImage& image) {
  for (std::size_t i = 0; i < image.radiance.size(); ++i)
    if (!isFinite(image.radiance[i]))
      throw NumericalError(fmt::format("render: pixel ({}, {}) is not finite",
                                       i % static_cast<std::size_t>(image.width),
                                       i / static_cast<std::size_t>(image.width)));
}

}  // namespace

FieldImage renderField(const ShadeRays& shade, const Camera& camera, int width, int height,
                       int spp, uint64_t seed, const std::function<void(double)>& progress) {
  if (width < 1 || height < 1 || width > 16384 || height > 16384)
    throwInput("image size {} x {}: each side takes 1 to 16384 pixels", width, height);
  if (spp < 1) throwInput("{} samples a pixel: at least 1 is needed", spp);
  FieldImage image;
  image.width = width;
  image.height = height;
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  image.radiance.resize(pixels);
  image.irradiance.resize(pixels);
  image.depth.resize(pixels);
  const float weight = 1.0f / static_cast<float>(spp);
  for (int sample = 0; sample < spp; ++sample) {
    throwIfInterrupted();
    const ShadedRays results = shade(pixelRays(camera, image, sample, seed));
    for (std::size_t i = 0; i < pixels; ++i) {
      const Vec4f& l = results.radiance[i];
      const Vec4f& e = results.irradiance[i];
      image.radiance[i] += Vec3f(l.x, l.y, l.z) * weight;
      image.irradiance[i] += Vec3f(e.x, e.y, e.z) * weight;
      const float distance = std::abs(l.w);
      image.depth[i] += distance < kMissDistance ? distance * weight : 0.0f;
    }
    if (progress) progress(static_cast<double>(sample + 1) / spp);
  }
  checkFinite(image);
  return image;
}

void drawProbes(FieldImage& image, ProbeField& field, const Camera& camera, float radius_m) {
  const FieldSnapshot snapshot = takeSnapshot(field);
  const auto gamma = static_cast<float>(field.params().encoding_gamma);
  const int n = snapshot.lattice.irradiance_texels;
  const auto width = static_cast<std::size_t>(image.width);
  parallelFor(image.radiance.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Ray ray =
          cameraRay(camera, image.width, image.height, static_cast<float>(i % width) + 0.5f,
                    static_cast<float>(i / width) + 0.5f);
      float nearest = image.depth[i] > 0 ? image.depth[i] : kMissDistance;
      for (std::size_t p = 0; p < field.states().positions.size(); ++p) {
        const Vec3f to_center = field.states().positions[p] - ray.origin;
        const float along = dot(to_center, ray.direction);
        const Vec3f across = to_center - ray.direction * along;
        const float inside = radius_m * radius_m - dot(across, across);
        if (inside <= 0 || along <= 0) continue;
        const float t = along - std::sqrt(inside);
        if (t <= 0 || t >= nearest) continue;
        nearest = t;
        const Vec3f normal = normalize(ray.direction * t - to_center);
        const Vec3f stored = readIrradiance(snapshot, static_cast<int>(p),
                                            octTaps(normal, n, snapshot.lattice.border));
        image.radiance[i] = pow(stored, Vec3f(gamma));
      }
    }
  });
}

}  // namespace probelab
