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

using std::numbers::pi;

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
      const double phi = 2 * pi * (j + 0.5) / kAngles;
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
  double mean = 0, square = 0;
  for (int t = 0; t < n * n; ++t) {
    const Vec3d d = texelDirection<double>(t % n, t / n, n);
    if (d.y > -0.707) continue;
    const LobeMoments m =
        planeMoments(1, std::acos(-d.y), params.distance_exponent, params.distance_clamp * unit);
    const Vec2f& stored = texels[static_cast<std::size_t>((t / n + 1) * side + t % n + 1)];
    mean = larger(mean, std::abs(static_cast<double>(stored.x) * unit / m.mean - 1));
    square = larger(square, std::abs(static_cast<double>(stored.y) * unit * unit / m.square - 1));
  }
  // A ray stands for the middle of a stratum of 4 pi / N; its mean differs by the stratum / 24
  // times the Laplacian on the sphere: 2 / c^2 of 1 / c, 6 / c^2 - 2 of 1 / c^2, c = cos 45
  // degrees. (An exponent off by one changes the mean by 8e-4, the square by 2e-3.)
  const double stratum = 4 * pi / params.rays / 24;
  return both(within(mean, 4 * stratum, "mean off by"),
              within(square, 10 * stratum, "square off by"));
}

// Behind a floor at 1.1 of its distance: what Chebyshev's bound, cubed, leaves of the light.
Measurement grazingWall(Workbench&, const CaseVariant&) {
  QueryParams<double> query{};
  query.chebyshev_power = 3;
  const auto seen = [&](double degrees) {
    const double beta = degrees * pi / 180;
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
            worst = larger(worst, -w);
            sums[texel] += w;
            if (w > largest[texel]) largest[texel] = w, most[texel] = table.entry_rays[e];
          }
      for (std::size_t t = 0; t < sums.size(); ++t) {
        worst = larger(worst, std::abs(sums[t] - 1));
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
    least = smaller(least, static_cast<double>(m.x));
    most = larger(most, static_cast<double>(m.x));
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
double falseDeviation() {
  double worst = 0;
  for (int i = 0; i < 20000; ++i) {
    const float r = static_cast<float>(0.05 + 1.45 * i / 20000);
    const uint32_t word = packHalfPair(r, r * r, kRoundToNearest);
    const Vec2f m = unpackMoments(PL_FORMAT_RG16F, PL_MOMENTS_RAW, &word);
    const double mean = static_cast<double>(m.x);
    worst = larger(worst, std::sqrt(std::abs(static_cast<double>(m.y) - mean * mean)) / mean);
  }
  return worst;
}

// Relative error of a deviation of 0.01 to 0.1 of the distance, stored beside it.
double deviationError() {
  double worst = 0;
  for (int i = 0; i < 20000; ++i) {
    const float r = static_cast<float>(0.05 + 1.45 * i / 20000);
    const float deviation = r * (0.01f + 0.09f * static_cast<float>(i % 100) / 100);
    const uint32_t word = packHalfPair(r, deviation, kRoundToNearest);
    const Vec2f m = unpackMoments(PL_FORMAT_RG16F, PL_MOMENTS_CENTRAL, &word);
    const double mean = static_cast<double>(m.x);
    const double back = std::sqrt(static_cast<double>(m.y) - mean * mean);
    worst = larger(worst, std::abs(back / static_cast<double>(deviation) - 1));
  }
  return worst;
}

Measurement halfMoments(Workbench&, const CaseVariant& variant) {
  // The deviation rounds to half an ulp, 2^-11. m1^2, their sum and the square round to 2^-24 of
  // m1^2, 1e4 times the least variance, of which the deviation is the root.
  if (variant.format == "central")
    return within(deviationError(), 0x1p-11 + 0.5 * 1e4 * 2.1 * 0x1p-24, "deviation off by");
  const double worst = falseDeviation();
  // m2 and m1^2 are off by half an ulp of 2^-10 and a whole one: 1.5 x 2^-10 at most, whose root is
  // 3.8 %.
  if (worst > std::sqrt(1.5 * 0x1p-10)) return within(worst, std::sqrt(1.5 * 0x1p-10));
  return limitAt(worst,
                 fmt::format("false deviation of up to {:.3g} % of the distance", 100 * worst));
}

Measurement trueVariance(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(4, 2, 2), builder.material(Vec3f(0.5f)), true);
  builder.box(Vec3f(1.8f, 0, 0.8f), Vec3f(2.2f, 2, 1.2f), builder.material(Vec3f(0.5f)), false);
  const BuiltScene scene(builder.finish());
  const ProbeLayout layout =
      fullLattice({Vec3f(0.5f), Vec3f(3.5f, 1.5f, 1.5f)}, Vec3i(3, 2, 2), scene.scene.bounds);
  const Params params = exactParams("rtxgi");
  const auto field = bench.field(scene, layout, params, variant);
  field->update(0, {}, {});
  const double unit = static_cast<double>(layout.support_radius_m);
  const int n = atlasSides(params).moments, side = n + 2;
  const std::vector<Vec3f> directions = updateDirections(params.rays, 0, 0);
  const std::vector<Vec2f> moments = field->momentTexels();
  // The lobe ends where a share of 1e-4 lies outside.
  const double cutoff = std::pow(1e-4, 1 / (params.distance_exponent + 1));
  double worst = 0, mean = 0;
  for (std::size_t p = 0; p < layout.positions.size(); ++p) {
    std::vector<double> distances;
    for (const Vec3f& d : directions)
      distances.push_back(std::min(
          static_cast<double>(scene.embree.closest({layout.positions[p], 0, d, 100}).t) / unit,
          params.distance_clamp));
    for (int t = 0; t < n * n; ++t) {
      const Vec3d u = texelDirection<double>(t % n, t / n, n);
      double sum = 0, first = 0, second = 0;
      for (std::size_t i = 0; i < directions.size(); ++i) {
        const double c = dot(u, Vec3d(directions[i]));
        const double w = c < cutoff ? 0 : std::pow(c, params.distance_exponent);
        sum += w, first += w * distances[i], second += w * distances[i] * distances[i];
      }
      const Vec2f& m = moments[p * static_cast<std::size_t>(side * side) +
                               static_cast<std::size_t>((t / n + 1) * side + t % n + 1)];
      const double x = static_cast<double>(m.x);
      const double truth = second / sum - (first / sum) * (first / sum);
      worst = larger(worst, std::abs(static_cast<double>(m.y) - x * x - truth));
      mean += truth / (n * n * static_cast<double>(layout.positions.size()));
    }
  }
  // Moments of at most 2.25 out of 256 rays, fp32: 260 roundings of 2^-25 of them, for m2 and twice
  // for m1^2.
  return both(within(worst, 3 * 260 * 0x1p-25 * 2.25, "variance off by, r_i^2:"),
              checked(mean > 1e-3, fmt::format("mean variance {:.2g}", mean)));
}

// Probes in closed solids see nothing but back faces.
Measurement backfaceDistances(Workbench& bench, const CaseVariant& variant) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(2), builder.material(Vec3f(0.5f), Vec3f(1)), false);
  const BuiltScene scene(builder.finish());
  const Params params = exactParams(variant.format);
  const auto field = bench.field(scene, furnaceLayout(scene.scene), params, {"embree", ""});
  for (uint64_t u = 0; u < 4; ++u)
    field->update(u, {.hysteresis = u == 0 ? 0.0f : 0.5f}, {.hysteresis = u == 0 ? 0.0f : 0.5f});
  // From (0.4)^3 the nearest wall is 0.4 m away, the farthest corner 1.6 sqrt(3), shortened.
  const double unit =
      static_cast<double>(furnaceLayout(scene.scene).support_radius_m) / params.backface_shortening;
  const double low = 0.4 / unit,
               high = std::min(params.distance_clamp, 1.6 * std::sqrt(3.0) / unit);
  double least = INFINITY, most = 0, variance = INFINITY;
  for (const Vec2f& m : field->momentTexels()) {
    const double x = static_cast<double>(m.x);
    least = smaller(least, x), most = larger(most, x);
    variance = smaller(variance, static_cast<double>(m.y) / (x * x) - 1);
  }
  return checked(
      least >= low * (1 - 1e-5) && most <= high * (1 + 1e-5) && variance >= -1e-5,
      fmt::format("{:.3g} to {:.3g} r_i, shortened {:.3g} to {:.3g}; least variance {:.1g} "
                  "of the square",
                  least, most, low, high, variance));
}

}  // namespace

std::vector<StabilityCase> momentCases() {
  const auto tracers = bothTracers();
  return {
      {"probe.moments_plane", "moments of a floor 1 m away, to 45 degrees",
       "the lobe's integral; strata of 4096 rays, / 24 times the Laplacian of r and r^2", "P7 P12",
       tracers, planeDistances},
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
       "fp16 moments of a known deviation",
       "raw, of 0: rounds to sqrt(1.5 x 2^-10) = 3.8 %; central, of 1 to 10 %: within 2^-11 + 6e-4",
       "G41 P6",
       {{"", "raw"}, {"", "central"}},
       halfMoments},
      {"probe.variance", "moments beside a pillar",
       "every texel's variance as summed in fp64, within 260 fp32 roundings", "P7", tracers,
       trueVariance},
      {"probe.backfaces",
       "probes that see nothing but back faces",
       "distances that rays found, times the preset's shortening; no negative variance",
       "P15",
       {{"", "rtxgi"}, {"", "gdc2019"}, {"", "probelab"}},
       backfaceDistances},
  };
}

}  // namespace probelab
