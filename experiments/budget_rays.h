// SPDX-License-Identifier: GPL-3.0-or-later
// The rays of probes as the reference sees them, and their sums in texels by the rules of the blend
// stage (shaders/ddgi/blend.comp.glsl), in double.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "ddgi/params.h"
#include "ddgi/weight_table.h"
#include "trace/path_tracer.h"

namespace probelab {

// What a probe's ray brings. Two estimates of its radiance from paths that share the hit alone.
struct ProbeRay {
  std::array<Vec3f, 2> radiance;
  float distance_m = 0;  // negative on a black back face, 1e27 on a miss
};

// How distances are stored: in units of the layout's r_i, cut off at the probe's own.
struct DistanceUnits {
  double unit_m = 1, largest = 1, backface_shortening = 1;

  double stored(float distance_m) const {
    const double d = static_cast<double>(distance_m);
    return std::min((d < 0 ? -d * backface_shortening : d) / unit_m, largest);
  }
};

class ProbeRayTracer {
 public:
  ProbeRayTracer(const Scene& scene, const EmbreeScene& embree, uint64_t seed)
      : tracer_(scene, embree), embree_(embree), seed_(seed) {}

  // Rays of one probe along `directions`, with `paths` (1 or 2) estimates of the radiance each, or
  // 0 for distances alone. Path s of ray i is a function of (seed, probe, pass + s, i). Throws
  // NumericalError where a radiance is not finite.
  void trace(const Vec3f& origin, std::span<const Vec3f> directions, int paths, uint64_t probe,
             uint32_t pass, std::span<ProbeRay> rays, RayCount& count) const;

  // Mean and mean square of the stored distance in the power-cosine lobe about a unit `axis`, from
  // `samples` directions that follow the lobe's own density, cut off as the weight tables are;
  // `turn` in [0, 1) rotates them about the axis.
  Vec2d lobeMoments(const Vec3f& origin, const Vec3f& axis, double exponent, int samples,
                    double turn, const DistanceUnits& rule, RayCount& count) const;

 private:
  PathTracer tracer_;
  const EmbreeScene& embree_;
  uint64_t seed_;
};

// Whether the parameters leave the probe's texels as they are, because too many rays meet back
// faces.
bool isFrozen(std::span<const ProbeRay> rays, const Params& params);

// Mean radiance under the cosine of a unit normal by the rays' estimate number `path`; 0 where back
// faces that are skipped leave too little.
Vec3f radianceUnderCosine(std::span<const ProbeRay> rays, std::span<const Vec3f> directions,
                          int path, const Vec3f& normal, const Params& params);

// Blends one update's rays into texels that hold the mean of `average_of` - 1 updates; interior
// texels, linear. `table` has blocks of one texel. Texels that a frozen probe or too few rays leave
// alone keep what they had (0 at first).
void blendRadiance(const WeightTable& table, std::span<const ProbeRay> rays, int path,
                   const Params& params, int average_of, std::span<Vec3f> texels);
void blendDistances(const WeightTable& table, std::span<const ProbeRay> rays,
                    const DistanceUnits& rule, int average_of, std::span<Vec2f> texels);

}  // namespace probelab
