// SPDX-License-Identifier: GPL-3.0-or-later
// One update of a field in plain C++ and double, straight from the published formulas: rays by the
// path tracer's parts, sums over all rays, the rules for history. Only the bounce asks the field
// itself (a snapshot of it), and the query has tests of its own.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/rng.h"
#include "ddgi/directions.h"
#include "ddgi/snapshot.h"
#include "ddgi/texel_fit.h"
#include "field_helpers.h"
#include "trace/path_tracer.h"

namespace probelab::test {

// A room of 4 x 2 x 2 m with boxes, lamps and a double-sided sheet at random; probes of a lattice
// in it lie in the open, in boxes and behind them.
inline Scene randomRoom(uint64_t seed) {
  Rng rng(seed, RngStream::test, 1);
  const auto number = [&](double low, double high) {
    return static_cast<float>(low + (high - low) * rng.nextDouble());
  };
  const auto color = [&](double high) {
    return Vec3f(number(0.05, high), number(0.05, high), number(0.05, high));
  };
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(4, 2, 2), builder.material(color(0.9)), true);
  for (int i = 0; i < 5; ++i) {
    const Vec3f size(number(0.3, 0.9), number(0.3, 0.9), number(0.3, 0.9));
    const Vec3f low(number(0.05, 3), number(0.05, 1), number(0.05, 1));
    builder.box(low, low + size, builder.material(color(0.9), i < 2 ? color(3) : Vec3f()), false);
  }
  const float x = number(2.5, 3.5);
  builder.quad(Vec3f(x, 0.4f, 0.4f), Vec3f(x, 0.4f, 1.6f), Vec3f(x, 1.6f, 1.6f),
               Vec3f(x, 1.6f, 0.4f), builder.material(color(0.9), Vec3f(), true));
  builder.pointLight(Vec3f(number(0.2, 3.8), 1.93f, number(0.2, 1.8)), color(3));
  return builder.finish();
}

// What a probe ray brings; the distance is negative on a back face.
struct RayValue {
  Vec3d radiance;
  double distance;
};

inline RayValue traceValue(const PathTracer& tracer, const EmbreeScene& embree, const Vec3f& origin,
                           const Vec3f& direction, const FieldSnapshot* previous) {
  const Hit hit = embree.closest({origin, 0, direction, 1e27f});
  if (hit.primitive == kNoHit) return {Vec3d(tracer.skyRadiance(direction)), 1e27};
  const Surface s = surfaceAt(tracer.geometry(), tracer.materials(), hit, direction);
  if (s.is_black_backface) return {Vec3d(), -static_cast<double>(hit.t)};
  RayCount rays;
  Vec3d irradiance(tracer.deltaIrradiance(s.point, s.geometric_normal, s.shading_normal, rays));
  if (previous != nullptr) {
    const QueryPoint point{s.point.position, s.shading_normal, direction};
    irradiance += querySnapshot<double>(*previous, previous->params, point).irradiance;
  }
  return {Vec3d(s.emission) + Vec3d(s.albedo) * irradiance / std::numbers::pi, hit.t};
}

// Interior texels of all probes, [probe][y][x]: encoded irradiance; mean and mean square of the
// distance in r_i.
struct Texels {
  std::vector<Vec3d> irradiance;
  std::vector<Vec2d> moments;
};

// Place in the stored array of interior texel number `texel` of a probe.
inline std::size_t storedTexel(int probe, int texel, int interior, int border) {
  const int side = interior + 2 * border;
  return static_cast<std::size_t>((probe * side + texel / interior + border) * side +
                                  texel % interior + border);
}

inline Texels storedTexels(ProbeField& field) {
  const AtlasSides sides = atlasSides(field.params());
  const std::vector<Vec3f> irradiance = field.irradianceTexels();
  const std::vector<Vec2f> moments = field.momentTexels();
  Texels texels;
  for (int p = 0; p < static_cast<int>(field.probeCount()); ++p) {
    for (int t = 0; t < sides.irradiance * sides.irradiance; ++t)
      texels.irradiance.emplace_back(irradiance[storedTexel(p, t, sides.irradiance, sides.border)]);
    if (moments.empty()) continue;
    for (int t = 0; t < sides.moments * sides.moments; ++t)
      texels.moments.emplace_back(moments[storedTexel(p, t, sides.moments, sides.border)]);
  }
  return texels;
}

// History and new value, both encoded -> what is stored. Thresholds of [RTXGI] act on stored values
// that are half as bright: e 2^(-1/gamma).
inline Vec3d mixByHand(const Params& params, double hysteresis, const Vec3d& before, Vec3d after) {
  double h = hysteresis;
  const Vec3d luminance(0.2126, 0.7152, 0.0722);
  const double half = std::pow(0.5, 1 / params.encoding_gamma);
  const bool rtxgi = params.change_detector == PL_CHANGE_RTXGI;
  if (rtxgi) {
    if (dot(before, before) == 0) h = 0;  // a black texel is written for the first time
    const Vec3d delta = (after - before) * half;
    if (maxComponent(-delta) > params.change_threshold) h = std::max(0.0, h - params.change_drop);
    if (dot(delta, luminance) > params.brightness_threshold)
      after = before + (after - before) * 0.25;
  } else if (params.change_detector == PL_CHANGE_M21) {
    double most = 0;
    for (std::size_t c = 0; c < 3; ++c)
      most = std::max(most, std::abs(after[c] - before[c]) / std::max({after[c], before[c], 1e-6}));
    if (most > params.change_threshold) h = std::max(0.0, h - params.change_drop);
    if (most > params.reset_threshold) h = 0;
  }
  if (params.hysteresis_space != 0) {
    const double g = params.encoding_gamma;
    return pow(pow(before, Vec3d(g)) * h + pow(after, Vec3d(g)) * (1 - h), Vec3d(1 / g));
  }
  Vec3d step = (after - before) * (1 - h);
  if (rtxgi && maxComponent(after) < maxComponent(before))
    for (std::size_t c = 0; c < 3; ++c) {
      const double least = params.darkening_step / half;
      const double size =
          std::min(std::max(std::abs(step[c]), least), std::abs(after[c] - before[c]));
      step[c] = std::copysign(size, step[c]);
    }
  return before + step;
}

class UpdateByHand {
 public:
  UpdateByHand(const FieldScene& scene, const ProbeField& field)
      : scene_(scene),
        field_(field),
        tracer_(scene.scene, scene.embree),
        params_(field.params()),
        sides_(atlasSides(field.params())) {
    if (params_.irradiance_fit != 0) fit_ = bilinearFit(sides_.irradiance);
  }

  // `before`: what the field stored, `previous`: the field that the bounce asks (null: none).
  // Only every `probe_step`th probe is computed; inactive ones keep what they had.
  Texels update(uint64_t rotation, double hysteresis, const Texels& before,
                const FieldSnapshot* previous, int probe_step = 1) const {
    const std::vector<Vec3f> directions =
        updateDirections(params_.rays, field_.options().seed, rotation);
    const Eigen::MatrixXd irradiance = weights(directions, sides_.irradiance, 1);
    const Eigen::MatrixXd moments = weights(directions, sides_.moments, params_.distance_exponent);
    Texels after = before;
    for (std::size_t p = 0; p < field_.probeCount(); p += static_cast<std::size_t>(probe_step)) {
      if (field_.states().active[p] == 0) continue;
      std::vector<RayValue> rays;
      for (const Vec3f& d : directions) {
        rays.push_back(traceValue(tracer_, scene_.embree, field_.states().positions[p], d,
                                  params_.feedback != 0 ? previous : nullptr));
        if (params_.radiance_clamp > 0)
          rays.back().radiance = componentMin(rays.back().radiance, Vec3d(params_.radiance_clamp));
      }
      blendIrradiance(rays, irradiance, hysteresis,
                      &after.irradiance[p * static_cast<std::size_t>(irradiance.rows())]);
      if (!after.moments.empty())
        blendMoments(rays, moments, hysteresis, probeLengths(field_.layout(), p).support,
                     &after.moments[p * static_cast<std::size_t>(moments.rows())]);
    }
    return after;
  }

 private:
  // Normalised weights [texel][ray]; a power lobe ends where less than 1e-4 of it lies outside, its
  // share below cosine c being c^(p + 1).
  Eigen::MatrixXd weights(const std::vector<Vec3f>& directions, int n, double exponent) const {
    const double cutoff = exponent == 1 ? 0 : std::pow(1e-4, 1 / (exponent + 1));
    Eigen::MatrixXd w(n * n, static_cast<Eigen::Index>(directions.size()));
    for (int t = 0; t < n * n; ++t) {
      const Vec3d u = texelDirection<double>(t % n, t / n, n);
      Eigen::Index nearest = 0;
      for (Eigen::Index r = 0; r < w.cols(); ++r) {
        const auto cosine = [&](Eigen::Index ray) {
          return dot(u, Vec3d(directions[static_cast<std::size_t>(ray)]));
        };
        w(t, r) = cosine(r) > cutoff ? std::pow(cosine(r), exponent) : 0;
        if (cosine(r) > cosine(nearest)) nearest = r;
      }
      if (w.row(t).sum() == 0) w(t, nearest) = 1;
      w.row(t) /= w.row(t).sum();
    }
    if (exponent == 1 && fit_.size() > 0) w = fit_ * w;
    return w;
  }

  void blendIrradiance(const std::vector<RayValue>& rays, const Eigen::MatrixXd& w,
                       double hysteresis, Vec3d* texels) const {
    const auto back = std::count_if(rays.begin(), rays.end(),
                                    [](const RayValue& ray) { return ray.distance < 0; });
    // The device compares in fp32, and so does this: 0.1f of 40 rays is not 4.
    if (static_cast<float>(back) >
        static_cast<float>(params_.backface_freeze) * static_cast<float>(rays.size()))
      return;
    for (Eigen::Index t = 0; t < w.rows(); ++t) {
      Vec3d sum;
      double weight = 0;
      for (std::size_t r = 0; r < rays.size(); ++r) {
        if (params_.backface_skip != 0 && rays[r].distance < 0) continue;
        sum += rays[r].radiance * w(t, static_cast<Eigen::Index>(r));
        weight += w(t, static_cast<Eigen::Index>(r));
      }
      if (weight <= 0.05) continue;  // too few rays count
      const Vec3d value =
          pow(componentMax(sum / weight, Vec3d(0)), Vec3d(1 / params_.encoding_gamma));
      texels[t] = hysteresis > 0 ? mixByHand(params_, hysteresis, texels[t], value) : value;
    }
  }

  // Distances in units of the layout's r_i, up to the clamp times the probe's own.
  void blendMoments(const std::vector<RayValue>& rays, const Eigen::MatrixXd& w, double hysteresis,
                    float support, Vec2d* texels) const {
    const auto unit = static_cast<double>(field_.layout().support_radius_m);
    const double clamp = params_.distance_clamp * static_cast<double>(support) / unit;
    for (Eigen::Index t = 0; t < w.rows(); ++t) {
      Vec2d sum;
      for (std::size_t r = 0; r < rays.size(); ++r) {
        double d = rays[r].distance;
        if (d < 0) d *= -params_.backface_shortening;
        const double q = std::min(d / unit, clamp);
        sum += Vec2d(q, q * q) * w(t, static_cast<Eigen::Index>(r));
      }
      texels[t] = sum * (1 - hysteresis) + texels[t] * hysteresis;
    }
  }

  const FieldScene& scene_;
  const ProbeField& field_;
  PathTracer tracer_;
  Params params_;
  AtlasSides sides_;
  Eigen::MatrixXd fit_;
};

// Distance between two neighbouring numbers of an irradiance format at a value.
inline double irradianceUlp(int format, std::size_t channel, double value) {
  const auto small = [&](int mantissa) {
    const int exponent = value > 0 ? std::ilogb(value) : -14;
    return std::ldexp(1.0, std::max(exponent, -14) - mantissa);
  };
  if (format == PL_FORMAT_RGBA32F) return 0;
  if (format == PL_FORMAT_RGBA16F) return small(10);
  if (format == PL_FORMAT_R11G11B10F) return small(channel < 2 ? 6 : 5);
  return 1.0 / 1023;
}

// Every interior texel; blending to 1e-4 of the largest value (sums cancel nothing), and an ulp of
// the format. Only every `probe_step`th probe was computed by hand.
inline void expectTexels(ProbeField& field, const Texels& expected, int probe_step = 1) {
  const Params& params = field.params();
  const Texels stored = storedTexels(field);
  const double top = params.irradiance_format == PL_FORMAT_RGB10A2 ? 1.0 : 1e30;
  double largest = 0;
  for (const Vec3d& e : expected.irradiance) largest = std::max(largest, maxComponent(e));
  ASSERT_GT(largest, 0);
  const std::size_t per_probe = stored.irradiance.size() / field.probeCount();
  for (std::size_t i = 0; i < stored.irradiance.size(); ++i) {
    if (i / per_probe % static_cast<std::size_t>(probe_step) != 0) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = std::min(expected.irradiance[i][c], top);
      ASSERT_NEAR(stored.irradiance[i][c], value,
                  1e-4 * largest + irradianceUlp(params.irradiance_format, c, value))
          << "probe " << i / per_probe << " texel " << i % per_probe;
    }
  }
  ASSERT_EQ(stored.moments.size(), expected.moments.size());
  const double ulp = params.moment_format == PL_FORMAT_RG32F ? 0 : 0x1p-10;  // relative
  const std::size_t per_map = stored.moments.size() / field.probeCount();
  for (std::size_t i = 0; i < stored.moments.size(); ++i) {
    if (i / per_map % static_cast<std::size_t>(probe_step) != 0) continue;
    const Vec2d& value = expected.moments[i];
    const double clamp = params.distance_clamp;
    ASSERT_NEAR(stored.moments[i].x, value.x, 1e-4 * clamp + ulp * value.x) << "texel " << i;
    // A central square is that of a rounded mean and of a rounded deviation: up to four ulps.
    ASSERT_NEAR(stored.moments[i].y, value.y, 1e-4 * clamp * clamp + 4 * ulp * value.y)
        << "texel " << i;
  }
}

}  // namespace probelab::test
