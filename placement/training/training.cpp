// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/training.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/parallel.h"
#include "ddgi/snapshot.h"
#include "placement/probe_bake.h"
#include "placement/training_data.h"
#include "trace/sampling.h"

namespace probelab {
namespace {

constexpr int kReceiverEmitterSamples = 32;
constexpr std::size_t kChunk = 1024;      // receivers traced at once
constexpr std::size_t kStatesAtOnce = 3;  // in the three channels of a query

// Rays about a receiver's normal, cosine-weighted.
std::vector<Ray> receiverRays(const Training::Data& data, std::span<const Receiver> receivers,
                              std::size_t first, int count) {
  std::vector<Ray> rays(receivers.size() * static_cast<std::size_t>(count));
  parallelFor(receivers.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Receiver& r = receivers[i];
      Rng rng(data.settings.seed, RngStream::placement, 4, first + i);
      const Vec2f turn(rng.nextFloat(), rng.nextFloat());
      const BoundedPoint point = pointWithoutTriangle(r.position, data.embree.extent());
      for (int k = 0; k < count; ++k)
        rays[i * static_cast<std::size_t>(count) + static_cast<std::size_t>(k)] =
            Ray{offsetOrigin(point, r.normal, r.normal), 0,
                cosineDirection(r.normal, k, count, turn), kFarDistance};
    }
  });
  return rays;
}

std::vector<Receiver> trainReceivers(const Training::Data& data) {
  const auto wanted = static_cast<std::size_t>(data.settings.receivers);
  // Half of the blocks are train blocks; what is too many is dropped from the end of each kind.
  const Receivers all =
      generateReceivers(data.scene, data.embree, data.reachability,
                        static_cast<uint32_t>(2 * wanted + 16), data.settings.seed + 0x7261);
  std::vector<Receiver> train;
  double sum = 0;
  for (const Receiver& r : all.points)
    if (r.split == data.settings.split) train.push_back(r), sum += r.area;
  if (train.empty())
    throwInput("{}: no receiver lies in a block of the split; enlarge the volume", data.scene.path);
  for (Receiver& r : train) r.area /= sum;
  return train;
}

void normalise(Training::Data& data) {
  const std::size_t states = data.patches->stateCount();
  data.power.assign(states, 0.0);
  data.mean.assign(states, 0.0);
  for (std::size_t r = 0; r < data.receivers.size(); ++r)
    for (std::size_t l = 0; l < states; ++l) {
      const double e = static_cast<double>(data.truth[r * states + l]);
      data.power[l] += data.receivers[r].area * e * e;
      data.mean[l] += data.receivers[r].area * e;
    }
}

// Rays that find every patch that matters: from receivers and, through them, all they see.
std::vector<Ray> startRays(const Training::Data& data) {
  return receiverRays(data, data.receivers, 0, 32);
}

void traceTraining(Training::Data& data) {
  data.receivers = trainReceivers(data);
  data.patches = std::make_unique<PatchCache>(
      data.scene, data.embree,
      trainingLighting(data.scene, data.embree, data.reachability,
                       {.split = data.settings.split,
                        .own = data.settings.own_lights,
                        .generated = data.settings.lights,
                        .lamps_each = data.settings.lamps_each,
                        .seed = data.settings.seed}),
      startRays(data), data.settings.seed);
  data.truth = gatherTruth(data, data.receivers, 0);
  normalise(data);
}

// A snapshot with the moments; irradiance is filled in for a few states at a time.
FieldSnapshot bakedSnapshot(const ProbeLayout& layout, const Params& params,
                            std::span<const BakedProbe> probes) {
  FieldSnapshot snapshot = layoutSnapshot(layout, initialStates(layout), params);
  snapshot.lattice.border = 0;
  const float unit = 1 / layout.support_radius_m;
  for (const BakedProbe& probe : probes)
    for (const Vec2f& m : probe.moments)
      snapshot.moments.push_back(Vec2f(m.x * unit, m.y * unit * unit));
  return snapshot;
}

}  // namespace

Training::Training(const Scene& scene, const EmbreeScene& embree, const Reachability& reachability,
                   const TrainingSettings& settings)
    : data_(new Data{scene, embree, reachability, settings, {}, {}, {}, {}, {}, 0}) {}
Training::~Training() = default;

Training::Data& Training::data() {
  if (!data_->traced()) traceTraining(*data_);
  return *data_;
}

uint64_t Training::evaluations() const { return data_->evaluations; }
const TrainingSettings& Training::settings() const { return data_->settings; }

std::vector<float> gatherTruth(const Training::Data& data, std::span<const Receiver> points,
                               uint64_t first_stream) {
  const std::size_t states = data.patches->stateCount();
  const int rays_each = data.settings.receiver_rays;
  const auto row = static_cast<std::size_t>(rays_each);
  std::vector<float> truth(points.size() * states, 0.0f);
  for (std::size_t first = 0; first < points.size(); first += kChunk) {
    throwIfInterrupted();
    const std::size_t count = std::min(kChunk, points.size() - first);
    const auto part = points.subspan(first, count);
    const std::vector<Ray> rays = receiverRays(data, part, first_stream + first, rays_each);
    std::vector<RaySample> samples(rays.size());
    data.patches->trace(rays, samples);
    parallelFor(count, 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const std::span<float> sum = std::span(truth).subspan((first + i) * states, states);
        for (std::size_t k = 0; k < row; ++k) {
          const RaySample& sample = samples[i * row + k];
          const float cosine = dot(part[i].normal, rays[i * row + k].direction);
          data.patches->addRadiance(
              sample, 1.0f / static_cast<float>(rays_each),
              PatchCache::emitterShare(sample, cosine, kReceiverEmitterSamples, rays_each),
              sum);
        }
        Rng rng(data.settings.seed, RngStream::placement, 5, first_stream + first + i);
        const Vec3f e =
            data.patches->emitted(rays[i * row].origin, part[i].normal, part[i].normal,
                                  kReceiverEmitterSamples, rays_each, rng);
        for (float& v : sum) v += luminance(e) / kPi;
      }
    });
  }
  return truth;
}

std::vector<float> estimateLayout(const Training::Data& data, const ProbeLayout& layout,
                                  const Params& params) {
  return estimateLayout(data, layout, params,
                        bakeLayout(*data.patches, layout, params, data.settings.seed));
}

std::vector<float> estimateLayout(const Training::Data& data, const ProbeLayout& layout,
                                  const Params& params, const LayoutBake& bake) {
  const std::size_t states = data.stateCount();
  const auto& [plan, probes] = bake;
  FieldSnapshot snapshot = bakedSnapshot(layout, params, probes);
  // The atlas holds irradiance / pi; encoding is left out.
  QueryParams<double> query = queryParams(params);
  query.decode_exponent = snapshot.modes.average == PL_AVERAGE_LINEAR ? 1.0 : 0.5;
  const QueryParams<float> query_params = convertQueryParams<float>(query);
  const auto texels = static_cast<std::size_t>(plan.irradiance_texels * plan.irradiance_texels);
  std::vector<float> estimates(data.receivers.size() * states);
  for (std::size_t first = 0; first < states; first += kStatesAtOnce) {
    const std::size_t some = std::min(kStatesAtOnce, states - first);
    snapshot.irradiance.assign(probes.size() * texels, Vec3f());
    for (std::size_t p = 0; p < probes.size(); ++p)
      for (std::size_t t = 0; t < texels; ++t)
        for (std::size_t l = 0; l < some; ++l)
          snapshot.irradiance[p * texels + t][l] = probes[p].mean_radiance[t * states + first + l];
    parallelFor(data.receivers.size(), 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) {
        const Receiver& receiver = data.receivers[r];
        const QueryPoint point{receiver.position, receiver.normal, receiver.view};
        const Vec3f e = querySnapshot(snapshot, query_params, point).irradiance / kPi;
        for (std::size_t l = 0; l < some; ++l) estimates[r * states + first + l] = e[l];
      }
    });
  }
  return estimates;
}

std::vector<double> squaredErrors(const Training::Data& data, std::span<const float> estimates) {
  const std::size_t states = data.stateCount();
  std::vector<double> errors(states, 0.0);
  for (std::size_t r = 0; r < data.receivers.size(); ++r)
    for (std::size_t l = 0; l < states; ++l) {
      const double d = static_cast<double>(estimates[r * states + l]) -
                       static_cast<double>(data.truth[r * states + l]);
      errors[l] += data.receivers[r].area * d * d;
    }
  for (std::size_t l = 0; l < states; ++l)
    errors[l] = data.power[l] > 0 ? errors[l] / data.power[l] : 0;
  return errors;
}

double Training::score(const ProbeLayout& layout, const Params& params, bool own_only) {
  Data& d = data();
  throwIfInterrupted();
  ++d.evaluations;
  validateLayout(layout, params);
  double sum = 0;
  std::size_t lit = 0;
  const std::vector<double> errors = squaredErrors(d, estimateLayout(d, layout, params));
  for (std::size_t l = 0; l < errors.size(); ++l)
    if (d.power[l] > 0 && (!own_only || d.patches->lighting()[l].own)) sum += errors[l], ++lit;
  return lit > 0 ? std::sqrt(sum / static_cast<double>(lit)) : 0;
}

}  // namespace probelab
