// SPDX-License-Identifier: GPL-3.0-or-later
// Distances: their moments in closed form and in half floats, grazing walls, back faces, few rays.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cases.h"
#include "ddgi/directions.h"
#include "ddgi/snapshot.h"
#include "ddgi/texels.h"
#include "ddgi/weight_table.h"
#include "shared/octahedral.h"

namespace probelab {
namespace {

constexpr double kPi = std::numbers::pi;

struct LobeMoments {
  double mean = 0, square = 0;
};
// Of the distance to a plane at `h`, over the cosine lobe of power k around a direction tilted by
// `beta` from the plane's normal, distances clamped: midpoints of 400 x 200 cells of the lobe.
LobeMoments planeMoments(double h, double beta, double k, double clamp) {
  LobeMoments m;
  constexpr int kAngles = 200, kHeights = 400;
  for (int i = 0; i < kHeights; ++i) {
    // cos^k has the distribution function 1 - c^(k+1) over c.
    const double c = std::pow((i + 0.5) / kHeights, 1 / (k + 1)), s = std::sqrt(1 - c * c);
    for (int j = 0; j < kAngles; ++j) {
      const double phi = 2 * kPi * (j + 0.5) / kAngles;
      const double down = c * std::cos(beta) + s * std::cos(phi) * std::sin(beta);
      const double r = down > 0 ? std::min(clamp, h / down) : clamp;
      m.mean += r / (kAngles * kHeights), m.square += r * r / (kAngles * kHeights);
    }
  }
  return m;
}

// One probe above a wide floor; texels that look down to 45 degrees.
Measurement planeDistances(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.quad(Vec3f(-60, 0, -60), Vec3f(-60, 0, 60), Vec3f(60, 0, 60), Vec3f(60, 0, -60),
               builder.material(Vec3f(0.5f)));
  builder.scene().bounds = {Vec3f(-2, 0, -2), Vec3f(2, 4, 2)};
  const BuiltScene scene(builder.finish());
  Params params = exactParams("rtxgi");
  params.rays = 4096;
  params.backface_shortening = 1;
  const ProbeLayout layout =
      fullLattice({Vec3f(-1, 0.5f, -1), Vec3f(1, 1.5f, 1)}, Vec3i(1, 1, 1), scene.scene.bounds);
  const auto field = bench.field(scene, layout, params, variant);
  field->update(0, {}, {});
  const double unit = static_cast<double>(layout.support_radius_m);
  const int n = atlasSides(params).moments, side = n + 2;
  const std::vector<Vec2f> texels = field->momentTexels();
  double worst = 0;
  for (int t = 0; t < n * n; ++t) {
    const Vec3d d = texelDirection<double>(t % n, t / n, n);
    if (d.y > -0.707) continue;
    const LobeMoments m =
        planeMoments(1, std::acos(-d.y), params.distance_exponent, params.distance_clamp * unit);
    const Vec2f& stored = texels[static_cast<std::size_t>((t / n + 1) * side + t % n + 1)];
    worst = std::max(worst, std::abs(static_cast<double>(stored.x) * unit / m.mean - 1));
    worst = std::max(worst, std::abs(static_cast<double>(stored.y) * unit * unit / m.square - 1));
  }
  // Some 40 of the rays fall into a lobe of 0.2 rad; the distance's deviation in it is at most 17 %
  // (45 degrees), twice that for the square. The spiral's points are strata 0.055 rad wide: four
  // errors of a stratified mean.
  return within(worst, 4 * 2 * 0.17 * (0.055 / 0.2) / std::sqrt(40.0), "error");
}

// Behind a floor at 1.1 of its distance: what Chebyshev's bound, cubed, leaves of the light.
Measurement grazingWall(Workbench&, const CaseVariant&) {
  QueryParams<double> query{};
  query.chebyshev_power = 3;
  const auto seen = [&](double degrees) {
    const double beta = degrees * kPi / 180;
    const LobeMoments m = planeMoments(1, beta, 50, 8);
    return visibilityWeight<double>(query, {m.mean, m.square}, 1.1 / std::cos(beta));
  };
  // The lobe of a straight view: mean h (k+1) / k.
  const double straight = std::abs(planeMoments(1, 0, 50, 8).mean / (51.0 / 50) - 1);
  if (straight > 1e-3) return within(straight, 1e-3, "mean");
  const double degrees = breakingPoint(
      5, 80, [&](double angle) { return seen(angle) <= 0.5; }, 0.005);
  return limitAt(degrees, fmt::format("half of the light passes from {:.3g} degrees on", degrees));
}

// Fewer rays than texels: every texel's weights.
Measurement sparseWeights(Workbench&, const CaseVariant&) {
  double worst = 0;
  bool alone = true;
  for (const int rays : {1, 2, 3, 5, 16, 64})
    for (const double exponent : {1.0, 50.0, 500.0}) {
      const std::vector<Vec3f> directions = updateDirections(rays, 1, 3);
      const WeightTable table =
          makeWeightTable(directions, {.texels = 14, .exponent = exponent}, 4);
      std::vector<double> sums(14 * 14, 0), largest(14 * 14, 0);
      std::vector<uint32_t> most(14 * 14, 0);
      for (uint32_t block = 0; block < table.blockCount(); ++block)
        for (uint32_t e = table.block_begin[block]; e < table.block_begin[block + 1]; ++e)
          for (int k = 0; k < table.block; ++k) {
            const uint32_t texel = table.block_texels[block * static_cast<uint32_t>(table.block) +
                                                      static_cast<uint32_t>(k)];
            if (texel == kNoTexel) continue;
            const double w = static_cast<double>(
                table.weights[e * static_cast<uint32_t>(table.block) + static_cast<uint32_t>(k)]);
            worst = std::max(worst, -w);
            sums[texel] += w;
            if (w > largest[texel]) largest[texel] = w, most[texel] = table.entry_rays[e];
          }
      for (std::size_t t = 0; t < sums.size(); ++t) {
        worst = std::max(worst, std::abs(sums[t] - 1));
        const Vec3d u =
            texelDirection<double>(static_cast<int>(t) % 14, static_cast<int>(t) / 14, 14);
        for (const Vec3f& d : directions)
          alone = alone && dot(u, Vec3d(d)) <= dot(u, Vec3d(directions[most[t]])) + 1e-6;
      }
    }
  // Each of up to 64 weights is rounded to 2^-25 of at most 1.
  return both(within(worst, 64 * 0x1p-25, "sum of weights - 1:"),
              checked(alone, alone ? "the nearest ray weighs most" : "not the nearest ray"));
}

// 16 rays, 196 texels: all hold a distance that some ray found.
Measurement fewRays(Workbench& bench, const CaseVariant& variant) {
  const BuiltScene scene(furnace(0.5f, 1));
  Params params = exactParams("rtxgi");
  params.rays = 16;
  const ProbeLayout layout = furnaceLayout(scene.scene);
  const auto field = bench.field(scene, layout, params, variant);
  field->update(0, {}, {});
  double least = 1e9, most = 0;
  for (const Vec2f& m : field->momentTexels()) {
    least = std::min(least, static_cast<double>(m.x));
    most = std::max(most, static_cast<double>(m.x));
  }
  const double unit = static_cast<double>(layout.support_radius_m);
  // From (0.4)^3 the nearest wall is 0.4 m away, the farthest corner 1.6 sqrt(3).
  const double low = 0.4 / unit,
               high = std::min(params.distance_clamp, 1.6 * std::sqrt(3.0) / unit);
  return checked(
      least >= low * (1 - 1e-5) && most <= high * (1 + 1e-5),
      fmt::format("{:.3g} to {:.3g} r_i, rays found {:.3g} to {:.3g}", least, most, low, high));
}

// The deviation that moments of a constant distance report, over the distance.
double falseDeviation(int encoding) {
  double worst = 0;
  for (int i = 0; i < 20000; ++i) {
    const float r = static_cast<float>(0.05 + 1.45 * i / 20000);
    const bool raw = encoding == PL_MOMENTS_RAW;
    const uint32_t word = packHalfPair(r, raw ? r * r : 0.0f, kRoundToNearest);
    const Vec2f m = unpackMoments(PL_FORMAT_RG16F, encoding, &word);
    const double mean = static_cast<double>(m.x);
    worst = std::max(worst, std::sqrt(std::abs(static_cast<double>(m.y) - mean * mean)) / mean);
  }
  return worst;
}

Measurement halfMoments(Workbench&, const CaseVariant& variant) {
  const bool raw = variant.format == "raw";
  const double worst = falseDeviation(raw ? PL_MOMENTS_RAW : PL_MOMENTS_CENTRAL);
  // m2 and m1^2 are off by half an ulp of 2^-10 and a whole one: 1.5 x 2^-10 at most, whose root is
  // 3.8 %. Central moments store the deviation itself; m1^2 + 0 rounds to fp32.
  if (!raw) return within(worst, std::sqrt(0x1p-23), "deviation / distance:");
  if (worst > std::sqrt(1.5 * 0x1p-10)) return within(worst, std::sqrt(1.5 * 0x1p-10));
  return limitAt(worst,
                 fmt::format("false deviation of up to {:.3g} % of the distance", 100 * worst));
}

Measurement trueVariance(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(4, 2, 2), builder.material(Vec3f(0.5f)), true);
  builder.box(Vec3f(1.8f, 0, 0.8f), Vec3f(2.2f, 2, 1.2f), builder.material(Vec3f(0.5f)), false);
  const BuiltScene scene(builder.finish());
  const auto field = bench.field(
      scene,
      fullLattice({Vec3f(0.5f), Vec3f(3.5f, 1.5f, 1.5f)}, Vec3i(3, 2, 2), scene.scene.bounds),
      exactParams("rtxgi"), variant);
  field->update(0, {}, {});
  double least = 1, mean = 0;
  const std::vector<Vec2f> moments = field->momentTexels();
  for (const Vec2f& m : moments) {
    const double x = static_cast<double>(m.x), variance = static_cast<double>(m.y) - x * x;
    least = std::min(least, variance / (x * x));
    mean += variance / static_cast<double>(moments.size());
  }
  return checked(
      least >= -1e-5 && mean > 1e-3,
      fmt::format("mean variance {:.2g} r_i^2, least {:.1g} of the square", mean, least));
}

// Probes in closed solids see nothing but back faces.
Measurement backfaceDistances(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0.5f), Vec3f(1)), false);
  const BuiltScene scene(builder.finish());
  const Params params = exactParams(variant.format);
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params, {"embree", ""});
  for (uint64_t u = 0; u < 4; ++u) field->update(u, {.hysteresis = 0.5f}, {.hysteresis = 0.5f});
  double least = 1e9;
  for (const Vec2f& m : field->momentTexels())
    least = std::min({least, static_cast<double>(m.x), static_cast<double>(m.y)});
  return checked(least >= 0, fmt::format("least moment {:.2g}", least));
}

}  // namespace

std::vector<StabilityCase> momentCases() {
  const auto tracers = bothTracers();
  return {
      {"probe.moments_plane", "moments of a floor 1 m away, to 45 degrees",
       "the lobe's integral; 4 errors of a stratified mean of 40 rays", "P7 P12", tracers,
       planeDistances},
      {"probe.grazing_wall",
       "a wall seen at an angle, lobe cos^50",
       "less than half of the light from behind it at 1.1 of its distance, to 80 degrees",
       "P12",
       {},
       grazingWall},
      {"probe.sparse_weights",
       "1 to 64 rays for 196 texels",
       "weights not negative, sum 1 (2^-25 each), a texel without rays takes the nearest",
       "P13",
       {},
       sparseWeights},
      {"probe.few_rays", "16 rays for 196 texels", "every distance is one that rays found", "P13",
       tracers, fewRays},
      {"probe.half_moments",
       "fp16 moments of a constant distance",
       "deviation 0; raw moments round to sqrt(1.5 x 2^-10) = 3.8 %",
       "G41 P6",
       {{"", "raw"}, {"", "central"}},
       halfMoments},
      {"probe.variance", "moments beside a pillar",
       "the mean of squares, not the square of the mean", "P7", tracers, trueVariance},
      {"probe.backfaces",
       "probes that see nothing but back faces",
       "no negative moment",
       "P15",
       {{"", "rtxgi"}, {"", "gdc2019"}, {"", "probelab"}},
       backfaceDistances},
  };
}

}  // namespace probelab
