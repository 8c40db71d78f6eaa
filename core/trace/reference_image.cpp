// SPDX-License-Identifier: Apache-2.0
#include "trace/reference_image.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/parallel.h"
#include "base/timer.h"
#include "pass_schedule.h"
#include "trace/sampler.h"
#include "trace/sampling.h"
#include "trace/surface.h"

namespace probelab {
namespace {

constexpr uint32_t kSamplesPerPass = 4;
constexpr std::size_t kPixelsPerTask = 64;

// One camera sample; layers as in ReferenceImage.
struct PixelSample {
  Vec3f radiance, emission, direct, irradiance, albedo, normal;
  float depth = 0;
  float hits = 0;
};

PixelSample tracePixel(const PathTracer& tracer, const Ray& ray, const PathSampler& sampler,
                       RayCount& rays) {
  PixelSample sample;
  ++rays.closest;
  const Hit hit = tracer.embree().closest(ray);
  if (hit.primitive == kNoHit) {
    sample.radiance = sample.emission = tracer.skyRadiance(ray.direction);
    return sample;
  }
  const Surface surface = surfaceAt(tracer.geometry(), tracer.materials(), hit, ray.direction);
  sample.normal = surface.shading_normal;
  sample.depth = hit.t;
  sample.hits = 1;
  if (surface.is_black_backface) return sample;
  sample.albedo = surface.albedo;
  sample.emission = surface.emission;
  sample.direct =
      tracer.deltaIrradiance(surface.point, surface.geometric_normal, surface.shading_normal, rays);
  sample.irradiance = tracer.fieldIrradiance(surface.point, surface.geometric_normal,
                                             surface.shading_normal, sampler, rays);
  sample.radiance =
      sample.emission + sample.albedo * (sample.direct + sample.irradiance) * (1.0f / kPi);
  return sample;
}

// Running sums of the layers that have no halves.
struct LayerSums {
  Vec3f emission, direct, irradiance, albedo, normal;
  float depth = 0, hits = 0;

  void add(const PixelSample& s) {
    emission += s.emission, direct += s.direct, irradiance += s.irradiance;
    albedo += s.albedo, normal += s.normal;
    depth += s.depth, hits += s.hits;
  }
};

Vec3f unitOrZero(const Vec3f& v) {
  const float l = length(v);
  return l > 1e-6f ? v / l : Vec3f();
}

void finishLayers(const std::vector<PassSums>& sums, const std::vector<LayerSums>& layers,
                  uint32_t samples, ReferenceImage& image) {
  const float share = 1.0f / static_cast<float>(samples);
  for (std::size_t i = 0; i < sums.size(); ++i) {
    image.radiance.push_back(Vec3f(sums[i].mean()));
    image.half_a.push_back(sums[i].halfA());
    image.half_b.push_back(sums[i].halfB());
    image.variance.push_back(Vec3f(sums[i].varianceOfMean()));
    image.emission.push_back(layers[i].emission * share);
    image.direct.push_back(layers[i].direct * share);
    image.irradiance.push_back(layers[i].irradiance * share);
    image.albedo.push_back(layers[i].albedo * share);
    image.normal.push_back(unitOrZero(layers[i].normal));
    image.depth.push_back(layers[i].hits > 0 ? layers[i].depth / layers[i].hits : 0.0f);
  }
}

// The larger of the mean errors of bright and of dark pixels (SampleBudget).
double imageError(const std::vector<PassSums>& sums) {
  const double threshold = darkThreshold(sums);
  std::vector<double> bright, dark;
  for (const PassSums& s : sums)
    (luminance(s.mean()) > threshold ? bright : dark).push_back(relativeError(s, threshold));
  return std::max(meanOf(bright), meanOf(dark));
}

}  // namespace

Ray cameraRay(const Camera& camera, int width, int height, float x, float y) {
  const float scale = std::tan(0.5f * camera.vertical_fov_rad);
  const float aspect = static_cast<float>(width) / static_cast<float>(height);
  const float sx = (2.0f * x / static_cast<float>(width) - 1.0f) * aspect * scale;
  const float sy = (1.0f - 2.0f * y / static_cast<float>(height)) * scale;
  const Vec3f right = cross(camera.forward, camera.up);
  return {camera.position, 0, normalize(camera.forward + right * sx + camera.up * sy),
          kFarDistance};
}

ReferenceImage renderReference(const Scene& scene, const EmbreeScene& embree, const Camera& camera,
                               int width, int height, const SampleBudget& budget, uint64_t seed,
                               const std::function<void(double)>& progress) {
  if (width < 1 || height < 1 || width > 16384 || height > 16384)
    throwInput("image size {} x {}: both must be between 1 and 16384", width, height);
  const Timer timer;
  const PathTracer tracer(scene, embree);
  PassSchedule schedule(budget, kSamplesPerPass);
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::vector<PassSums> sums(pixels);
  std::vector<LayerSums> layers(pixels);
  ReferenceImage image;
  image.width = width, image.height = height;
  std::atomic<uint64_t> closest{0}, shadow{0};

  const auto tracePass = [&](std::size_t i, uint32_t pass, RayCount& rays) {
    Vec3d sum;
    for (uint32_t s = 0; s < kSamplesPerPass; ++s) {
      const PathSampler sampler(seed, RngStream::reference_image, i, pass, s);
      const Vec2f jitter = sampler.pair(0);
      const auto column = static_cast<float>(i % static_cast<std::size_t>(width));
      const auto row = static_cast<float>(i / static_cast<std::size_t>(width));
      const Ray ray = cameraRay(camera, width, height, column + jitter.x, row + jitter.y);
      const PixelSample sample = tracePixel(tracer, ray, sampler, rays);
      layers[i].add(sample);
      sum += Vec3d(sample.radiance);
    }
    if (!isFinite(sum))
      throw NumericalError(fmt::format("reference image: a sample of pixel ({}, {}) is not finite",
                                       i % static_cast<std::size_t>(width),
                                       i / static_cast<std::size_t>(width)));
    sums[i].add(pass, sum / static_cast<double>(kSamplesPerPass));
  };

  while (const uint32_t count = schedule.next(image.rel_error, timer.seconds())) {
    const uint32_t first = schedule.passes() - count;
    parallelFor(pixels, kPixelsPerTask, [&](std::size_t begin, std::size_t end) {
      throwIfInterrupted();
      const FlushDenormals flush;
      RayCount rays;
      for (std::size_t i = begin; i < end; ++i)
        for (uint32_t pass = first; pass < first + count; ++pass) tracePass(i, pass, rays);
      closest += rays.closest, shadow += rays.shadow;
    });
    image.rel_error = imageError(sums);
    if (progress) progress(schedule.share(schedule.passes(), image.rel_error, timer.seconds()));
  }
  finishLayers(sums, layers, schedule.samples(), image);
  image.samples = schedule.samples();
  image.rays = {closest, shadow};
  image.seconds = timer.seconds();
  return image;
}

}  // namespace probelab
