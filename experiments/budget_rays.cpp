// SPDX-License-Identifier: GPL-3.0-or-later
#include "budget_rays.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "ddgi/constants.h"
#include "trace/sampler.h"
#include "trace/sampling.h"

namespace probelab {
namespace {

// A texel of which less than this share of the weight counts keeps its value.
constexpr double kLeastShare = 0.05;

bool counts(const ProbeRay& ray, const Params& params) {
  return params.backface_skip == 0 || ray.distance_m >= 0;
}

}  // namespace

void ProbeRayTracer::trace(const Vec3f& origin, std::span<const Vec3f> directions, int paths,
                           uint64_t probe, uint32_t pass, std::span<ProbeRay> rays,
                           RayCount& count) const {
  for (std::size_t i = 0; i < directions.size(); ++i) {
    ProbeRay& ray = rays[i];
    ray = {};
    ++count.closest;
    const Hit hit = embree_.closest(Ray{origin, 0, directions[i], kFarDistance});
    if (hit.primitive == kNoHit) {
      ray.radiance.fill(tracer_.skyRadiance(directions[i]));
      ray.distance_m = kMissDistance;
      continue;
    }
    const Surface s = surfaceAt(tracer_.geometry(), tracer_.materials(), hit, directions[i]);
    ray.distance_m = s.is_black_backface ? -hit.t : hit.t;
    if (paths == 0 || s.is_black_backface) continue;
    ray.radiance.fill(s.emission);
    if (maxComponent(s.albedo) <= 0) continue;
    const Vec3f direct =
        tracer_.deltaIrradiance(s.point, s.geometric_normal, s.shading_normal, count);
    for (int path = 0; path < paths; ++path) {
      const PathSampler sampler(seed_, RngStream::budget, probe, pass + static_cast<uint32_t>(path),
                                static_cast<uint32_t>(i));
      const Vec3f field =
          tracer_.fieldIrradiance(s.point, s.geometric_normal, s.shading_normal, sampler, count);
      Vec3f& radiance = ray.radiance[static_cast<std::size_t>(path)];
      radiance += s.albedo * (direct + field) / kPi;
      if (!isFinite(radiance))
        throw NumericalError(
            fmt::format("budget: a path from probe {} has a radiance that is not finite", probe));
    }
  }
}

Vec2d ProbeRayTracer::lobeMoments(const Vec3f& origin, const Vec3f& axis, double exponent,
                                  int samples, double turn, const DistanceUnits& rule,
                                  RayCount& count) const {
  // The lobe's share below cosine c is c^(exponent + 1).
  const Frame frame = frameAround(axis);
  const double least = exponent == 1 ? 0 : kDroppedShare;
  Vec2d sum;
  for (int i = 0; i < samples; ++i) {
    const double share = least + (1 - least) * (i + 0.5) / samples;
    const double cosine = std::pow(share, 1 / (exponent + 1));
    const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    const double phi = 2 * std::numbers::pi * (turn + i * (std::numbers::phi - 1));
    const Vec3f direction = normalize(frame.x * static_cast<float>(std::cos(phi) * sine) +
                                      frame.y * static_cast<float>(std::sin(phi) * sine) +
                                      frame.z * static_cast<float>(cosine));
    ++count.closest;
    const Hit hit = embree_.closest(Ray{origin, 0, direction, kFarDistance});
    float distance_m = kMissDistance;
    if (hit.primitive != kNoHit) {
      const Surface s = surfaceAt(tracer_.geometry(), tracer_.materials(), hit, direction);
      distance_m = s.is_black_backface ? -hit.t : hit.t;
    }
    const double q = rule.stored(distance_m);
    sum += Vec2d(q, q * q);
  }
  return sum * (1.0 / samples);
}

bool isFrozen(std::span<const ProbeRay> rays, const Params& params) {
  if (params.backface_freeze >= 1) return false;
  const auto back = std::count_if(rays.begin(), rays.end(),
                                  [](const ProbeRay& ray) { return ray.distance_m < 0; });
  // As the device compares, in fp32.
  return static_cast<float>(back) >
         static_cast<float>(params.backface_freeze) * static_cast<float>(rays.size());
}

Vec3f radianceUnderCosine(std::span<const ProbeRay> rays, std::span<const Vec3f> directions,
                          int path, const Vec3f& normal, const Params& params) {
  Vec3d sum;
  double counted = 0, total = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto cosine = static_cast<double>(dot(normal, directions[i]));
    if (cosine <= 0) continue;
    total += cosine;
    if (!counts(rays[i], params)) continue;
    counted += cosine;
    sum += Vec3d(rays[i].radiance[static_cast<std::size_t>(path)]) * cosine;
  }
  return counted > kLeastShare * total ? Vec3f(sum * (1 / counted)) : Vec3f();
}

void blendRadiance(const WeightTable& table, std::span<const ProbeRay> rays, int path,
                   const Params& params, int average_of, std::span<Vec3f> texels) {
  PROBELAB_CHECK_EQ(table.block, 1);
  const bool frozen = isFrozen(rays, params);
  for (std::size_t block = 0; block < table.blockCount(); ++block) {
    Vec3d sum;
    double counted = 0;
    for (uint32_t e = table.block_begin[block]; e < table.block_begin[block + 1]; ++e) {
      const ProbeRay& ray = rays[table.entry_rays[e]];
      if (!counts(ray, params)) continue;
      const auto weight = static_cast<double>(table.weights[e]);
      sum += Vec3d(ray.radiance[static_cast<std::size_t>(path)]) * weight;
      counted += weight;
    }
    Vec3f& texel = texels[table.block_texels[block]];
    const bool keeps = frozen || counted <= kLeastShare;
    const Vec3f mean = keeps ? texel : Vec3f(componentMax(sum / counted, Vec3d(0)));
    texel += (mean - texel) / static_cast<float>(average_of);
  }
}

void blendDistances(const WeightTable& table, std::span<const ProbeRay> rays,
                    const DistanceUnits& rule, int average_of, std::span<Vec2f> texels) {
  PROBELAB_CHECK_EQ(table.block, 1);
  std::vector<double> stored(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) stored[i] = rule.stored(rays[i].distance_m);
  for (std::size_t block = 0; block < table.blockCount(); ++block) {
    Vec2d sum;
    for (uint32_t e = table.block_begin[block]; e < table.block_begin[block + 1]; ++e) {
      const double q = stored[table.entry_rays[e]];
      sum += Vec2d(q, q * q) * static_cast<double>(table.weights[e]);
    }
    Vec2f& texel = texels[table.block_texels[block]];
    texel += (Vec2f(sum) - texel) * (1.0f / static_cast<float>(average_of));
  }
}

}  // namespace probelab
