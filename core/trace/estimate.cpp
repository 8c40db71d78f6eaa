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

// Points whose passes go on together.
using Group = std::vector<std::size_t>;
enum class Count { bright, dark, all };  // whose errors make the median

// One estimate in the making.
struct Estimation {
  PathTracer tracer;
  std::span<const IrradiancePoint> points;
  uint64_t seed;
  std::vector<PassSums> sums;
  double threshold = 0;  // dark below
  std::atomic<uint64_t> closest{0}, shadow{0};
  Timer timer;

  Estimation(const Scene& scene, const EmbreeScene& embree,
             std::span<const IrradiancePoint> points_, uint64_t seed_)
      : tracer(scene, embree), points(points_), seed(seed_), sums(points_.size()) {}

  void trace(const Group& group, uint32_t first, uint32_t count) {
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

  double medianError(const Group& group, Count counted) const {
    std::vector<double> errors;
    for (const std::size_t i : group) {
      const bool is_bright = luminance(sums[i].mean()) > threshold;
      if (counted == Count::all || is_bright == (counted == Count::bright))
        errors.push_back(relativeError(sums[i], threshold));
    }
    return medianOf(std::move(errors));
  }

  // Goes on until the budget is met for this group; returns its median error.
  double run(const Group& group, Count counted, uint32_t first, PassSchedule& schedule,
             const std::function<void(double)>& progress) {
    double error = schedule.passes() > 0 ? medianError(group, counted) : 0;
    if (group.empty()) return error;
    while (const uint32_t count = schedule.next(error, timer.seconds())) {
      trace(group, first + schedule.passes() - count, count);
      error = medianError(group, counted);
      if (progress) progress(schedule.share(schedule.passes(), error, timer.seconds()));
    }
    return error;
  }

  // Short passes at all points, left out of the result: they tell which points are dark, and
  // whether connections to lit surfaces pay (variance times rays).
  void pilot(const Group& all) {
    const auto cost = [&](bool connect) {
      tracer.setConnections(connect);
      const uint64_t before = closest + shadow;
      std::fill(sums.begin(), sums.end(), PassSums());
      trace(all, 0, kPilotPasses);
      threshold = darkThreshold(sums);
      const double error = medianError(all, Count::all);
      return error * error * static_cast<double>(closest + shadow - before);
    };
    if (tracer.connects()) {
      const double without = cost(false);
      if (cost(true) > without) tracer.setConnections(false);
    } else {
      cost(false);
    }
  }
};

}  // namespace

// A relative error is reached by bright and dark points on their own, since dark ones often need
// many times the samples. The groups come from a pilot that is then left out, so that the number of
// samples does not depend on the values that are averaged but for their scatter.
IrradianceEstimate estimateIrradiance(const Scene& scene, const EmbreeScene& embree,
                                      std::span<const IrradiancePoint> points,
                                      const SampleBudget& budget, uint64_t seed,
                                      const std::function<void(double)>& progress) {
  checkPoints(points);
  Estimation estimation(scene, embree, points, seed);
  PassSchedule schedule(budget, kSamplesPerPass), dark_schedule(budget, kSamplesPerPass);
  Group bright(points.size()), dark;
  std::iota(bright.begin(), bright.end(), std::size_t{0});
  uint32_t first = 0;
  if (budget.rel_error > 0) {
    estimation.pilot(bright);
    const auto split = std::stable_partition(bright.begin(), bright.end(), [&](std::size_t i) {
      return luminance(estimation.sums[i].mean()) > estimation.threshold;
    });
    dark.assign(split, bright.end());
    bright.erase(split, bright.end());
    std::fill(estimation.sums.begin(), estimation.sums.end(), PassSums());
    first = kPilotPasses;
  }
  IrradianceEstimate result;
  result.rel_error = estimation.run(bright, Count::all, first, schedule, progress);
  if (!dark.empty() && schedule.passes() > 0) {
    // As many as the bright ones first: the pilot takes some points for dark that are not.
    estimation.trace(dark, first, schedule.passes());
    dark_schedule.resume(schedule.passes());
  }
  result.rel_error =
      std::max(result.rel_error, estimation.run(dark, Count::dark, first, dark_schedule, progress));
  for (const PassSums& s : estimation.sums) {
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
