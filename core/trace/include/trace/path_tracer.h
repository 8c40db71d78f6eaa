// SPDX-License-Identifier: Apache-2.0
// The path-traced reference: radiance along rays and field irradiance at points. Unbiased:
// next-event estimation with multiple importance sampling for emissive triangles and the sky image,
// all point, spot and directional lights at every bounce, Russian roulette, nothing clamped.
//
//   L_out = Le + albedo / pi (E_delta + E);  E = field irradiance: emitters, sky, every bounce
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "base/rng.h"
#include "scene/scene.h"
#include "shared/light.h"
#include "trace/embree_scene.h"
#include "trace/surface.h"

namespace probelab {

class PathSampler;         // trace/sampler.h
class LightSampler;        // trace/light_sampling.h
class LightVertexSampler;  // trace/light_vertices.h

// What one path costs; summed into provenance.
struct RayCount {
  uint64_t closest = 0, shadow = 0;
  uint64_t total() const { return closest + shadow; }
};

// Estimators of one sample each. References to `scene` and `embree` are kept.
class PathTracer {
 public:
  PathTracer(const Scene& scene, const EmbreeScene& embree);
  ~PathTracer();

  // Connections to surfaces that lamps shine on: on where there are lamps, until switched off. The
  // mean is the same either way; whether they pay depends on the scene.
  bool connects() const { return connect_; }
  void setConnections(bool on);

  // E_delta at a surface: direct irradiance, shadowed, exact but for rounding.
  Vec3f deltaIrradiance(const BoundedPoint& point, const Vec3f& geometric_normal,
                        const Vec3f& shading_normal, RayCount& rays) const;
  // One sample of the field irradiance at a surface (without E_delta there).
  Vec3f fieldIrradiance(const BoundedPoint& point, const Vec3f& geometric_normal,
                        const Vec3f& shading_normal, const PathSampler& sampler,
                        RayCount& rays) const;
  Vec3f skyRadiance(const Vec3f& direction) const;

  const EmbreeScene& embree() const { return embree_; }
  const MaterialTable& materials() const { return materials_; }
  const Geometry& geometry() const { return *scene_.geometry; }

 private:
  struct Vertex;
  struct Arrival;
  Vec3f lightsAt(const Surface& surface, const Arrival* arrival, RayCount& rays) const;
  Vec3f emitterIrradiance(const Vertex& vertex, const PathSampler& sampler, uint32_t dimension,
                          RayCount& rays) const;
  Vec3f connectedIrradiance(const Vertex& vertex, const PathSampler& sampler, uint32_t dimension,
                            RayCount& rays) const;

  const Scene& scene_;
  const EmbreeScene& embree_;
  MaterialTable materials_;
  std::vector<LightData> lights_;
  std::unique_ptr<LightSampler> emitters_;
  std::unique_ptr<LightVertexSampler> light_vertices_;
  bool connect_ = false;
};

struct IrradiancePoint {
  Vec3f position;  // local metres
  Vec3f normal;    // unit
};

// When to stop: at `spp` samples a point, after `seconds`, or at `rel_error`, whichever comes
// first; 0 leaves one out. Without any of the three: 1,024 samples. `max_spp` ends a rel_error that
// is not reached. Samples come in passes of 16, two at a time (one for each half), so spp is
// rounded up to a multiple of 32. Only `seconds` makes a result depend on the machine.
//
// rel_error: the median over points of the standard error of (A+B)/2 over its value (luminance),
// among those above 0.01 of the mean; the others go on until the median of their standard error is
// the same share of 0.01 of the mean. Images take means over pixels instead of medians.
struct SampleBudget {
  uint32_t spp = 0;
  double seconds = 0;
  double rel_error = 0;
  uint32_t max_spp = 1u << 17;
};

struct IrradianceEstimate {
  std::vector<Vec3f> a, b;            // independent halves, [point]
  std::vector<Vec3f> standard_error;  // of (a+b)/2, from the variance across passes, [point]
  uint32_t samples = 0;               // per point, both halves together; dark ones may have more
  RayCount rays;
  double seconds = 0;
  double rel_error = 0;  // reached, as SampleBudget defines it
};

// Field irradiance (without E_delta) at points. The same seed gives the same bytes whatever the
// number of threads. `progress` gets the share done in [0, 1], from this thread. Throws
// NumericalError naming the point when a sample is not finite, Interrupted on SIGINT.
IrradianceEstimate estimateIrradiance(const Scene& scene, const EmbreeScene& embree,
                                      std::span<const IrradiancePoint> points,
                                      const SampleBudget& budget, uint64_t seed,
                                      const std::function<void(double)>& progress = {});

// E_delta at the points themselves, [point].
std::vector<Vec3f> directIrradiance(const Scene& scene, const EmbreeScene& embree,
                                    std::span<const IrradiancePoint> points);

}  // namespace probelab
