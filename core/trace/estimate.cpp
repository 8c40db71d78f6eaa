// SPDX-License-Identifier: Apache-2.0
// Field irradiance at points, pass by pass until the budget is spent.
#include <atomic>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/parallel.h"
#include "base/timer.h"
#include "pass_schedule.h"
#include "trace/path_tracer.h"
#include "trace/sampler.h"

namespace probelab {
namespace {

// A power of two keeps the sample sequence stratified; many small passes measure the variance.
constexpr uint32_t kSamplesPerPass = 16;
constexpr std::size_t kPointsPerTask = 4;

void checkPoints(std::span<const IrradiancePoint> points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3f& n = points[i].normal;
    if (!isFinite(points[i].position) || !(std::abs(dot(n, n) - 1.0f) < 1e-3f))
      throw NumericalError(
          fmt::format("reference: point {} is not finite or its normal is not of unit length", i));
  }
}

Vec3d tracePass(const PathTracer& tracer, const BoundedPoint& point, const Vec3f& normal,
                uint64_t seed, std::size_t index, uint32_t pass, RayCount& rays) {
  Vec3d sum;
  for (uint32_t s = 0; s < kSamplesPerPass; ++s) {
    const PathSampler sampler(seed, RngStream::receiver_truth, index, pass, s);
    sum += Vec3d(tracer.fieldIrradiance(point, normal, normal, sampler, rays));
  }
  if (!isFinite(sum))
    throw NumericalError(fmt::format("reference: a sample of point {} is not finite", index));
  return sum / static_cast<double>(kSamplesPerPass);
}

}  // namespace

IrradianceEstimate estimateIrradiance(const Scene& scene, const EmbreeScene& embree,
                                      std::span<const IrradiancePoint> points,
                                      const SampleBudget& budget, uint64_t seed,
                                      const std::function<void(double)>& progress) {
  const Timer timer;
  checkPoints(points);
  const PathTracer tracer(scene, embree);
  PassSchedule schedule(budget, kSamplesPerPass);
  std::vector<PassSums> sums(points.size());
  IrradianceEstimate result;
  std::atomic<uint64_t> closest{0}, shadow{0};
  while (const uint32_t count = schedule.next(result.rel_error, timer.seconds())) {
    const uint32_t first = schedule.passes() - count;
    parallelFor(points.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
      throwIfInterrupted();
      const FlushDenormals flush;
      RayCount rays;
      for (std::size_t i = begin; i < end; ++i) {
        const BoundedPoint point = pointWithoutTriangle(points[i].position, embree.extent());
        for (uint32_t pass = first; pass < first + count; ++pass)
          sums[i].add(pass, tracePass(tracer, point, points[i].normal, seed, i, pass, rays));
      }
      closest += rays.closest, shadow += rays.shadow;
    });
    result.rel_error = relativeError(sums, schedule.passes(), Center::median);
    if (progress) progress(schedule.share(schedule.passes(), result.rel_error, timer.seconds()));
  }
  for (const PassSums& s : sums) {
    result.a.push_back(s.halfA(schedule.passes()));
    result.b.push_back(s.halfB(schedule.passes()));
    result.standard_error.push_back(Vec3f(sqrt(s.varianceOfMean(schedule.passes()))));
  }
  result.samples = schedule.samples();
  result.rays = {closest, shadow};
  result.seconds = timer.seconds();
  return result;
}

std::vector<Vec3f> directIrradiance(const Scene& scene, const EmbreeScene& embree,
                                    std::span<const IrradiancePoint> points) {
  checkPoints(points);
  const PathTracer tracer(scene, embree);
  std::vector<Vec3f> result(points.size());
  parallelFor(points.size(), 256, [&](std::size_t begin, std::size_t end) {
    const FlushDenormals flush;
    RayCount rays;
    for (std::size_t i = begin; i < end; ++i)
      result[i] = tracer.deltaIrradiance(pointWithoutTriangle(points[i].position, embree.extent()),
                                         points[i].normal, points[i].normal, rays);
  });
  return result;
}

}  // namespace probelab
