// SPDX-License-Identifier: Apache-2.0
#include "ddgi/field_constants.h"

#include <cmath>

#include "ddgi/probe_atlas.h"

namespace probelab {
namespace {

struct FieldConstants {
  LatticeShape lattice;
  QueryParams<float> query;
  DistanceRule distance;
};

// For powParameter (shared/language.h).
int halvesOf(double exponent) {
  const double halves = 2 * exponent;
  return halves == std::floor(halves) && halves < 16 ? static_cast<int>(halves) : -1;
}

}  // namespace

GpuBuffer uploadFieldConstants(GpuContext& context, const ProbeLayout& layout,
                               const Params& params) {
  const FieldConstants constants{
      latticeShape(layout, params),
      convertQueryParams<float>(queryParams(params)),
      {1.0f / layout.support_radius_m, static_cast<float>(params.distance_clamp),
       static_cast<float>(params.backface_shortening)}};
  return createBufferFrom(context, std::span<const FieldConstants>(&constants, 1),
                          MemoryUse::device, "field constants");
}

Defines fieldDefines(const Params& params, const LayoutUse& use) {
  const QueryModes modes = queryModes(params);
  Defines defines = atlasDefines(params);
  const auto add = [&](const char* name, int value) {
    defines.emplace_back(name, std::to_string(value));
  };
  const AtlasSides sides = atlasSides(params);
  add("PL_IRRADIANCE_TEXELS", sides.irradiance);
  add("PL_MOMENT_TEXELS", sides.moments);
  const QueryParams<double> query = queryParams(params);
  add("PL_CHEBYSHEV_HALVES", halvesOf(query.chebyshev_power));
  add("PL_DECODE_HALVES", halvesOf(query.decode_exponent));
  add("PL_INTERPOLANT", use.interpolant);
  add("PL_FACING", modes.facing);
  add("PL_TRILINEAR", modes.trilinear);
  add("PL_VISIBILITY", modes.visibility);
  add("PL_CRUSH", modes.crush);
  add("PL_AVERAGE", modes.average);
  add("PL_FALLBACK", modes.fallback);
  add("PL_MOVED", use.moved ? 1 : 0);
  add("PL_FULL_LATTICE", use.full ? 1 : 0);
  add("PL_OFFSET_WEIGHTS", modes.offset_weights);
  add("PL_WALLS", use.walls ? 1 : 0);
  add("PL_PARALLAX", modes.parallax);
  return defines;
}

Defines resolveDefines(const Params& params, const LayoutUse& layout, RayUse rays) {
  const bool camera = rays == RayUse::camera;
  Defines defines = fieldDefines(params, layout);
  const auto flag = [&](const char* name, bool on) { defines.emplace_back(name, on ? "1" : "0"); };
  flag("PL_STORE_IRRADIANCE", camera);
  flag("PL_STORE_DISTANCES", !camera && params.visibility != 0);
  flag("PL_FEEDBACK", camera || params.feedback != 0);
  flag("PL_RADIANCE_CLAMP", !camera && params.radiance_clamp > 0);
  return defines;
}

}  // namespace probelab
