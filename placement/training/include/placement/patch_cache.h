// SPDX-License-Identifier: GPL-3.0-or-later
// Outgoing light of the scene's surfaces under many lighting states at once. Surfaces are cut into
// patches by a grid of cells and by normals; a patch holds the irradiance (direct and indirect) of
// a few points in it. Transport is linear and paths do not depend on lights, so patches gather
// along rays that are traced once, for all states together, until the bounces have settled. A ray
// of a receiver or a probe then finds its radiance under every state at the patch that it hits,
// with the albedo of the very hit. Against path tracing this blurs direct light within a patch,
// nothing else.
#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "base/rng.h"
#include "placement/lighting.h"
#include "scene/scene.h"
#include "trace/embree_scene.h"
#include "trace/light_sampling.h"
#include "trace/surface.h"

namespace probelab {

// What a ray brings under state l: luminance(constant) + sky_scale[l] * luminance(sky) + albedo /
// pi times the patch's irradiance.
struct RaySample {
  int32_t patch = -1;  // -1: none
  Vec3f albedo;
  Vec3f emission;
  float emitter_pdf = 0;  // density, per steradian, with which emitted() would find the hit
  float sky = 0;          // luminance
  float distance_m = 0;   // negative at a black back face, kFarDistance on a miss
};

class PatchCache {
 public:
  // `start`: rays from where the light is wanted; patches that they cannot reach by any number of
  // bounces are not made. References to scene and embree are kept.
  PatchCache(const Scene& scene, const EmbreeScene& embree, std::vector<Lighting> lighting,
             std::span<const Ray> start, uint64_t seed);

  std::size_t stateCount() const { return lighting_.size(); }
  const std::vector<Lighting>& lighting() const { return lighting_; }
  std::size_t patchCount() const { return patches_.size(); }

  // [ray]; parallel.
  void trace(std::span<const Ray> rays, std::span<RaySample> samples) const;

  // Adds weight * luminance of the radiance under every state to sum[state]; `emission_share` is
  // the part of the emission that counts here (emitterShare).
  void addRadiance(const RaySample& sample, float weight, float emission_share,
                   std::span<float> sum) const;

  // Irradiance that emissive triangles send to a point, from `samples` points on them, for the
  // part that `rays` cosine-weighted rays do not count (balance heuristic). `origin` lies off the
  // surface.
  Vec3f emitted(const Vec3f& origin, const Vec3f& geometric_normal, const Vec3f& shading_normal,
                int samples, int rays, Rng& rng) const;
  // The part of what one of those rays brings that counts; `cosine` with the shading normal.
  static float emitterShare(const RaySample& sample, float cosine, int samples, int rays);

 private:
  struct Point {
    Vec3f origin, geometric_normal, shading_normal;
  };
  struct Patch {
    std::vector<Point> points;
    bool gathered = false;
    Vec3f emission;  // sum over its rays, as far as it counts there
    Vec3f sky;       // sum of the sky's radiance, scale 1, over its rays
  };
  struct Link {
    int32_t patch;
    Vec3f albedo;
  };
  float pdfOf(const Hit& hit, const Ray& ray, const Surface& surface) const;
  int32_t findPatch(const Surface& surface) const;
  uint64_t keyOf(const Vec3f& p, const Vec3f& normal, const Vec3i& shift) const;
  void insertHits(std::span<const Ray> rays, std::span<const Hit> hits);
  void gather(std::size_t first, std::size_t last, uint64_t seed);
  void lightPatches();
  void settle();
  struct Sweep {
    std::vector<double> change, total;  // [state] of irradiance, summed over patches
  };
  Sweep sweepPatches(std::span<const float> fixed);

  const Scene& scene_;
  const EmbreeScene& embree_;
  std::vector<Lighting> lighting_;
  MaterialTable materials_;
  Sky unit_sky_;  // the scene's with scale 1
  LightSampler emitters_;
  float cell_m_ = 0;
  Vec3f low_;
  std::unordered_map<uint64_t, int32_t> index_;
  std::vector<Patch> patches_;
  std::vector<std::vector<Link>> links_;  // [patch]
  std::vector<float> irradiance_;         // [patch][rgb][state]
};

// Cosine-weighted directions about a normal: sample i of n of a stratified set, turned by `turn`.
Vec3f cosineDirection(const Vec3f& normal, int i, int n, const Vec2f& turn);

}  // namespace probelab
