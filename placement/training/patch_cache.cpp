// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/patch_cache.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/parallel.h"
#include "base/rng.h"
#include "shared/octahedral.h"
#include "trace/light_sampling.h"
#include "trace/sampling.h"

namespace probelab {
namespace {

constexpr float kCellsPerDiagonal = 160;
constexpr int kNormalCells = 5;     // an edge of the octahedral map of normals
constexpr std::size_t kPoints = 4;  // of a patch
constexpr int kGatherRays = 64;     // of a patch
constexpr std::size_t kMaxPatches = 400000;
constexpr int kTrialSweeps = 64;   // then it is told whether light will settle at all,
constexpr int kMostSweeps = 4096;  // in so many
constexpr std::size_t kSweepParts = 8;
constexpr double kSettled = 1e-3;  // of a state's light, may be missing

constexpr int kEmitterSamples = 4;  // of a patch's point

Sky withUnitScale(Sky sky) {
  sky.scale = 1;
  return sky;
}

}  // namespace

Vec3f cosineDirection(const Vec3f& normal, int i, int n, const Vec2f& turn) {
  const auto wrap = [](float x) { return x - std::floor(x); };
  const float u =
      wrap((static_cast<float>(i) + 0.5f) / static_cast<float>(n) + turn.x / static_cast<float>(n));
  const float v = wrap(static_cast<float>(i) * 0.61803399f + turn.y);
  return sampleCosine(normal, {u, v});
}

PatchCache::PatchCache(const Scene& scene, const EmbreeScene& embree,
                       std::vector<Lighting> lighting, std::span<const Ray> start, uint64_t seed)
    : scene_(scene),
      embree_(embree),
      lighting_(std::move(lighting)),
      materials_(makeMaterialTable(scene)),
      unit_sky_(withUnitScale(scene.sky)),
      emitters_(*scene.geometry, materials_, unit_sky_) {
  const Box3f& box = scene.geometry->triangles.empty() ? scene.bounds : scene.geometry->box;
  cell_m_ = length(box.extent()) / kCellsPerDiagonal;
  low_ = box.min - Vec3f(0.37f * cell_m_);  // so that walls on round coordinates lie within cells
  std::vector<Hit> hits(start.size());
  embree.closest(start, hits);
  insertHits(start, hits);
  for (std::size_t done = 0; done < patches_.size();) {
    const std::size_t last = patches_.size();
    gather(done, last, seed);
    done = last;
  }
  lightPatches();
  settle();
}

uint64_t PatchCache::keyOf(const Vec3f& p, const Vec3f& normal, const Vec3i& shift) const {
  const auto cellOf = [&](std::size_t axis) {
    return static_cast<uint64_t>(
        static_cast<int64_t>(std::floor((p[axis] - low_[axis]) / cell_m_)) + shift[axis] + 64);
  };
  const Vec2f e = octEncode(normal);
  const auto octCell = [](float x) {
    return static_cast<uint64_t>(
        std::clamp(static_cast<int>((x * 0.5f + 0.5f) * kNormalCells), 0, kNormalCells - 1));
  };
  return ((cellOf(0) * 4096 + cellOf(1)) * 4096 + cellOf(2)) * 64 + octCell(e.x) * kNormalCells +
         octCell(e.y);
}

int32_t PatchCache::findPatch(const Surface& surface) const {
  const Vec3f& p = surface.point.position;
  const Vec3f& n = surface.geometric_normal;
  if (const auto found = index_.find(keyOf(p, n, Vec3i(0, 0, 0))); found != index_.end())
    return found->second;
  for (int i = 0; i < 27; ++i) {
    const Vec3i shift(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    if (const auto found = index_.find(keyOf(p, n, shift)); found != index_.end())
      return found->second;
  }
  return -1;
}

// Makes patches of what the rays hit, or adds points to those that have few.
void PatchCache::insertHits(std::span<const Ray> rays, std::span<const Hit> hits) {
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].primitive == kNoHit) continue;
    const Surface surface = surfaceAt(*scene_.geometry, materials_, hits[i], rays[i].direction);
    if (surface.is_black_backface) continue;
    const uint64_t key = keyOf(surface.point.position, surface.geometric_normal, Vec3i(0, 0, 0));
    auto found = index_.find(key);
    if (found == index_.end()) {
      if (patches_.size() >= kMaxPatches) continue;
      found = index_.emplace(key, static_cast<int32_t>(patches_.size())).first;
      patches_.emplace_back();
      links_.emplace_back();
    }
    Patch& patch = patches_[static_cast<std::size_t>(found->second)];
    if (patch.points.size() >= kPoints || patch.gathered) continue;
    const Vec3f& n = surface.geometric_normal;
    patch.points.push_back({offsetOrigin(surface.point, n, n), n, surface.shading_normal});
  }
}

// Traces the gather rays of patches first to last, and makes the patches that they hit.
void PatchCache::gather(std::size_t first, std::size_t last, uint64_t seed) {
  constexpr std::size_t kChunk = 1 << 14;  // patches
  for (std::size_t begin = first; begin < last; begin += kChunk) {
    throwIfInterrupted();
    const std::size_t end = std::min(last, begin + kChunk);
    std::vector<Ray> rays((end - begin) * kGatherRays);
    parallelFor(end - begin, 256, [&](std::size_t b, std::size_t e) {
      for (std::size_t i = b; i < e; ++i) {
        Patch& patch = patches_[begin + i];
        patch.gathered = true;
        Rng rng(seed, RngStream::placement, 2, begin + i);
        const Vec2f turn(rng.nextFloat(), rng.nextFloat());
        for (int r = 0; r < kGatherRays; ++r) {
          const Point& point = patch.points[static_cast<std::size_t>(r) % patch.points.size()];
          Vec3f d = cosineDirection(point.shading_normal, r, kGatherRays, turn);
          // Below the true horizon of a shading normal nothing arrives.
          const bool above = dot(d, point.geometric_normal) > 0;
          rays[i * kGatherRays + static_cast<std::size_t>(r)] =
              Ray{point.origin, 0, d, above ? kFarDistance : -1.0f};
        }
      }
    });
    std::vector<Hit> hits(rays.size());
    embree_.closest(rays, hits);
    insertHits(rays, hits);
    parallelFor(end - begin, 256, [&](std::size_t b, std::size_t e) {
      for (std::size_t i = b; i < e; ++i) {
        Patch& patch = patches_[begin + i];
        for (std::size_t r = 0; r < kGatherRays; ++r) {
          const Ray& ray = rays[i * kGatherRays + r];
          const Hit& hit = hits[i * kGatherRays + r];
          if (!(ray.t_max > 0)) continue;
          if (hit.primitive == kNoHit) {
            patch.sky += emitters_.sky().radiance(ray.direction);
            continue;
          }
          const Surface s = surfaceAt(*scene_.geometry, materials_, hit, ray.direction);
          if (s.is_black_backface) continue;
          if (maxComponent(s.emission) > 0) {
            RaySample found;
            found.emitter_pdf = pdfOf(hit, ray, s);
            const Point& point = patch.points[r % patch.points.size()];
            patch.emission +=
                s.emission * emitterShare(found, dot(ray.direction, point.shading_normal),
                                          kEmitterSamples * static_cast<int>(patch.points.size()),
                                          kGatherRays);
          }
          const int32_t to = findPatch(s);
          if (to >= 0) links_[begin + i].push_back({to, s.albedo});
        }
      }
    });
  }
}

// Direct irradiance of every patch under every state.
void PatchCache::lightPatches() {
  const std::size_t states = stateCount();
  irradiance_.assign(patches_.size() * 3 * states, 0.0f);
  parallelFor(patches_.size(), 128, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      Rng rng(0, RngStream::placement, 3, p);
      for (const Point& point : patches_[p].points) {
        const float count = static_cast<float>(patches_[p].points.size());
        const Vec3f emitter = emitted(point.origin, point.geometric_normal, point.shading_normal,
                                      kEmitterSamples * static_cast<int>(patches_[p].points.size()),
                                      kGatherRays, rng);
        for (std::size_t l = 0; l < states; ++l) {
          for (std::size_t c = 0; c < 3; ++c)
            irradiance_[(p * 3 + c) * states + l] += emitter[c] / count;
          for (const LightData& light : lighting_[l].lights) {
            const LightSample sample = sampleLight(light, point.origin);
            const float cosine = dot(point.shading_normal, sample.direction);
            if (!(cosine > 0) || !(dot(point.geometric_normal, sample.direction) > 0)) continue;
            if (maxComponent(sample.irradiance) <= 0) continue;
            if (embree_.occluded(Ray{point.origin, 0, sample.direction, sample.t_max})) continue;
            for (std::size_t c = 0; c < 3; ++c)
              irradiance_[(p * 3 + c) * states + l] += sample.irradiance[c] * (cosine / count);
          }
        }
      }
    }
  });
}

// E = E_delta + pi / rays * sum (emission + sky + albedo / pi E), until nothing changes.
void PatchCache::settle() {
  const std::size_t states = stateCount();
  parallelFor(patches_.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p)
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t l = 0; l < states; ++l)
          irradiance_[(p * 3 + c) * states + l] +=
              kPi / kGatherRays *
              (patches_[p].emission[c] + lighting_[l].sky_scale * patches_[p].sky[c]);
  });
  const std::vector<float> fixed = irradiance_;  // what does not bounce here
  std::vector<double> before(states, 0.0);
  std::vector<uint8_t> settled(states, 0);
  for (int sweep = 1; std::ranges::count(settled, 0) > 0; ++sweep) {
    throwIfInterrupted();
    const Sweep done = sweepPatches(fixed);
    for (std::size_t l = 0; l < states; ++l) {
      // What is left of this state if its changes go on falling like this.
      const double rate = before[l] > 0 ? done.change[l] / before[l] : 1;
      const double left = rate < 1 ? done.change[l] * rate / (1 - rate) : INFINITY;
      if (done.change[l] == 0 || left <= kSettled * done.total[l]) settled[l] = 1;
      const double at_last = left * std::pow(rate, kMostSweeps - sweep);
      if (!settled[l] && sweep >= kTrialSweeps && !(at_last <= kSettled * done.total[l]))
        throwInput(
            "{}: light bounces almost without end between its surfaces, which takes {} sweeps and "
            "more; lower the albedos that are near to 1",
            scene_.path, kMostSweeps);
    }
    before = done.change;
  }
  links_.clear();
}

// Gathers at every patch once. Each part of the patches sees what the parts before it have become
// (Gauss-Seidel), which takes about half of the sweeps and is the same for any number of threads.
PatchCache::Sweep PatchCache::sweepPatches(std::span<const float> fixed) {
  const std::size_t states = stateCount(), row = 3 * states;
  Sweep sweep{std::vector<double>(states), std::vector<double>(states)};
  std::vector<float> next;
  for (std::size_t part = 0; part < kSweepParts; ++part) {
    const std::size_t first = patches_.size() * part / kSweepParts;
    const std::size_t last = patches_.size() * (part + 1) / kSweepParts;
    next.assign(fixed.begin() + static_cast<std::ptrdiff_t>(first * row),
                fixed.begin() + static_cast<std::ptrdiff_t>(last * row));
    parallelFor(last - first, 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t p = begin; p < end; ++p) {
        float* sum = &next[p * row];
        for (const Link& link : links_[first + p]) {
          const float* from = &irradiance_[static_cast<std::size_t>(link.patch) * row];
          for (std::size_t c = 0; c < 3; ++c) {
            const float k = link.albedo[c] / kGatherRays;
            for (std::size_t l = 0; l < states; ++l)
              sum[c * states + l] += k * from[c * states + l];
          }
        }
      }
    });
    for (std::size_t i = 0; i < next.size(); i += states)
      for (std::size_t l = 0; l < states; ++l) {
        float& here = irradiance_[first * row + i + l];
        sweep.change[l] += std::abs(static_cast<double>(next[i + l] - here));
        sweep.total[l] += static_cast<double>(next[i + l]);
        here = next[i + l];
      }
  }
  return sweep;
}

float PatchCache::pdfOf(const Hit& hit, const Ray& ray, const Surface& surface) const {
  if (!(maxComponent(surface.emission) > 0)) return 0;
  return emitters_.trianglePdf(hit.primitive, hit.t, dot(surface.geometric_normal, ray.direction));
}

void PatchCache::trace(std::span<const Ray> rays, std::span<RaySample> samples) const {
  PROBELAB_CHECK_EQ(rays.size(), samples.size());
  std::vector<Hit> hits(rays.size());
  embree_.closest(rays, hits);
  parallelFor(rays.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      RaySample& sample = samples[i] = {};
      if (hits[i].primitive == kNoHit) {
        sample.distance_m = kFarDistance;
        if (rays[i].t_max > 0) sample.sky = luminance(emitters_.sky().radiance(rays[i].direction));
        continue;
      }
      const Surface s = surfaceAt(*scene_.geometry, materials_, hits[i], rays[i].direction);
      sample.distance_m = s.is_black_backface ? -hits[i].t : hits[i].t;
      if (s.is_black_backface) continue;
      sample.emission = s.emission;
      sample.emitter_pdf = pdfOf(hits[i], rays[i], s);
      sample.albedo = s.albedo;
      sample.patch = findPatch(s);
    }
  });
}

float PatchCache::emitterShare(const RaySample& sample, float cosine, int samples, int rays) {
  const float by_ray = static_cast<float>(rays) * std::max(cosine, 0.0f) / kPi;
  const float by_emitter = static_cast<float>(samples) * sample.emitter_pdf;
  return by_ray > 0 ? by_ray / (by_ray + by_emitter) : 0;
}

Vec3f PatchCache::emitted(const Vec3f& origin, const Vec3f& geometric_normal,
                          const Vec3f& shading_normal, int samples, int rays, Rng& rng) const {
  Vec3f sum;
  if (emitters_.empty()) return sum;
  for (int i = 0; i < samples; ++i) {
    const float choice = (static_cast<float>(i) + rng.nextFloat()) / static_cast<float>(samples);
    const Vec2f u(rng.nextFloat(), rng.nextFloat());
    const EmitterSample light = emitters_.sample(origin, choice, u);
    if (!(light.pdf > 0) || !(light.t_max < kFarDistance)) continue;  // the sky is not ours
    const float cosine = dot(shading_normal, light.direction);
    if (!(cosine > 0) || !(dot(geometric_normal, light.direction) > 0)) continue;
    if (embree_.occluded(Ray{origin, 0, light.direction, light.t_max})) continue;
    const float by_emitter = static_cast<float>(samples) * light.pdf;
    const float by_ray = static_cast<float>(rays) * cosine / kPi;
    sum += light.radiance * (cosine / (by_emitter + by_ray));
  }
  return sum;
}

void PatchCache::addRadiance(const RaySample& sample, float weight, float emission_share,
                             std::span<float> sum) const {
  const std::size_t states = stateCount();
  if (const float emission = luminance(sample.emission) * emission_share; emission != 0)
    for (std::size_t l = 0; l < states; ++l) sum[l] += weight * emission;
  if (sample.sky != 0)
    for (std::size_t l = 0; l < states; ++l) sum[l] += weight * sample.sky * lighting_[l].sky_scale;
  if (sample.patch < 0) return;
  const float* from = &irradiance_[static_cast<std::size_t>(sample.patch) * 3 * states];
  const float k = weight / kPi;
  const float r = 0.2126f * sample.albedo.x * k, g = 0.7152f * sample.albedo.y * k,
              b = 0.0722f * sample.albedo.z * k;
  for (std::size_t l = 0; l < states; ++l)
    sum[l] += r * from[l] + g * from[states + l] + b * from[2 * states + l];
}

}  // namespace probelab
