// SPDX-License-Identifier: GPL-3.0-or-later
#include "sky_dial.h"

#include <cmath>

#include "ddgi/directions.h"

namespace probelab {
namespace {

Scene skyScene(const Vec3f& a, float b) {
  SceneBuilder builder;
  builder.scene().sky.radiance = a;
  builder.scene().sky.linear = Vec3f(0, 0, b);
  builder.scene().bounds = {Vec3f(-1), Vec3f(1)};
  return builder.finish();
}

}  // namespace

SkyDial::SkyDial(const Vec3f& a, float b) : a_(a), b_(b), scene_(skyScene(a, b)) {}

std::unique_ptr<ProbeField> SkyDial::field(Workbench& bench, Params params) const {
  params.rays = 1;
  params.visibility = 0;
  if (params.fallback == PL_FALLBACK_LERP_UNOCCLUDED) params.fallback = PL_FALLBACK_NONE;
  const Box3f& bounds = scene_.scene.bounds;
  return bench.field(scene_, fullLattice(bounds, Vec3i(1, 1, 1), bounds), params);
}

Vec3d SkyDial::radiance(uint64_t rotation) const {
  const double height = static_cast<double>(updateDirections(1, 0, rotation).front().z);
  return Vec3d(a_) * (1 + static_cast<double>(b_) * height);
}

uint64_t SkyDial::rotationFor(double share) const {
  uint64_t best = 0;
  double least = INFINITY;
  for (uint64_t rotation = 0; rotation < 4000; ++rotation) {
    const double error = std::abs(radiance(rotation).x - share * static_cast<double>(a_.x));
    if (error < least) least = error, best = rotation;
  }
  return best;
}

double meanRadiance(ProbeField& field, std::size_t channel) {
  const std::vector<Vec3f> texels = field.irradianceTexels();
  double sum = 0;
  for (const Vec3f& t : texels)
    sum += std::pow(static_cast<double>(t[channel]), field.params().encoding_gamma);
  return sum / static_cast<double>(texels.size());
}

}  // namespace probelab
