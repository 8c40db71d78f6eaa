// SPDX-License-Identifier: Apache-2.0
// Field irradiance at points, pass by pass until the budget is spent.
#include <algorithm>
#include <atomic>
#include <numeric>

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
constexpr uint32_t kPilotPasses = 8;
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

// Points whose passes go on together, and their error so far.
using Group = std::vector<std::size_t>;

// One estimate in the making.
struct Estimation {
  const PathTracer& tracer;
  std::span<const IrradiancePoint> points;
  uint64_t seed;
  Timer timer = Timer();
  std::atomic<uint64_t> closest{0}, shadow{0};

  void trace(const Group& group, uint32_t first, uint32_t count, std::vector<PassSums>& sums) {
    const float extent = tracer.embree().extent();
    parallelFor(group.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
      throwIfInterrupted();
      const FlushDenormals flush;
      RayCount rays;
      for (std::size_t k = begin; k < end; ++k) {
        const std::size_t i = group[k];
        const BoundedPoint point = pointWithoutTriangle(points[i].position, extent);
        for (uint32_t pass = first; pass < first + count; ++pass)
          sums[i].add(pass, tracePass(tracer, point, points[i].normal, seed, i, pass, rays));
      }
      closest += rays.closest, shadow += rays.shadow;
    });
  }

  // Passes from `first` on until the budget is met for this group; its median error is returned.
  double run(const Group& group, uint32_t first, PassSchedule& schedule, double threshold,
             std::vector<PassSums>& sums, const std::function<void(double)>& progress) {
    double error = 0;
    while (const uint32_t count = schedule.next(error, timer.seconds())) {
      trace(group, first + schedule.passes() - count, count, sums);
      std::vector<double> errors;
      for (const std::size_t i : group) errors.push_back(relativeError(sums[i], threshold));
      error = medianOf(std::move(errors));
      if (progress) progress(schedule.share(schedule.passes(), error, timer.seconds()));
    }
    return error;
  }
};

}  // namespace

// A relative error is reached by bright and dark points on their own, since dark ones often need
// many times the samples. Which is which, and what dark means, comes from a pilot whose samples are
// then left out: the number of samples does not depend on the values that are averaged, but for the
// passes' variance.
IrradianceEstimate estimateIrradiance(const Scene& scene, const EmbreeScene& embree,
                                      std::span<const IrradiancePoint> points,
                                      const SampleBudget& budget, uint64_t seed,
                                      const std::function<void(double)>& progress) {
  checkPoints(points);
  const PathTracer tracer(scene, embree);
  Estimation estimation{tracer, points, seed};
  PassSchedule schedule(budget, kSamplesPerPass), dark_schedule(budget, kSamplesPerPass);
  Group all(points.size()), dark;
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::vector<PassSums> sums(points.size());
  double threshold = 0;
  Group bright = all;
  if (budget.rel_error > 0) {
    estimation.trace(all, 0, kPilotPasses, sums);
    threshold = darkThreshold(sums);
    std::erase_if(bright, [&](std::size_t i) { return luminance(sums[i].mean()) <= threshold; });
    for (const std::size_t i : all)
      if (luminance(sums[i].mean()) <= threshold) dark.push_back(i);
    std::fill(sums.begin(), sums.end(), PassSums());
  }
  const uint32_t first = budget.rel_error > 0 ? kPilotPasses : 0;
  const double share = static_cast<double>(bright.size()) / static_cast<double>(std::max<std::size_t>(1, all.size()));
  const auto report = [&](double from, double to) -> std::function<void(double)> {
    if (!progress) return {};
    return [&progress, from, to](double done) { progress(from + (to - from) * done); };
  };
  IrradianceEstimate result;
  result.rel_error =
      std::max(estimation.run(bright, first, schedule, threshold, sums, report(0, share)),
               estimation.run(dark, first, dark_schedule, threshold, sums, report(share, 1)));
  for (const PassSums& s : sums) {
    result.a.push_back(s.halfA());
    result.b.push_back(s.halfB());
    result.standard_error.push_back(Vec3f(sqrt(s.varianceOfMean())));
  }
  result.samples = bright.empty() ? dark_schedule.samples() : schedule.samples();
  result.rays = {estimation.closest, estimation.shadow};
  result.seconds = estimation.timer.seconds();
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
