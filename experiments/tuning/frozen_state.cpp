// SPDX-License-Identifier: GPL-3.0-or-later
#include "tuning/frozen_state.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "metrics/error.h"
#include "shared/light.h"
#include "shared/offset.h"

namespace probelab {
namespace {

constexpr double kDark = 0.1;           // of the mean, as for light_leak
constexpr float kSameView = 1 - 1e-5f;  // cosine above which two cameras look from one direction

// The receivers of the split as the metrics take them, so that sigma is the one of the leaks.
std::vector<double> pooledSigma(const std::vector<const Receiver*>& chosen) {
  std::vector<Vec3f> a, b, position;
  std::vector<float> area;
  std::vector<int> region, kind;
  bool has_kinds = true;
  for (const Receiver* r : chosen) {
    a.push_back(r->a), b.push_back(r->b), position.push_back(r->position);
    area.push_back(static_cast<float>(r->area)), region.push_back(r->region);
    kind.push_back(r->kind == ReceiverKind::surface ? kSurfaceReceiver : kVolumeReceiver);
    has_kinds = has_kinds && r->kind != ReceiverKind::point;
  }
  if (!has_kinds) kind.clear();
  std::vector<double> sigma = pooledVariance({.estimate = a,
                                              .a = a,
                                              .b = b,
                                              .position = position,
                                              .area = area,
                                              .region = region,
                                              .kind = kind});
  for (double& s : sigma) s = std::sqrt(s);
  return sigma;
}

// The receiver's own view and those of the other cameras that see it.
std::vector<Vec3f> viewsOf(const Receiver& receiver, std::span<const Vec3f> cameras,
                           const EmbreeScene& embree) {
  std::vector<Vec3f> views = {receiver.view};
  const bool on_surface = receiver.kind != ReceiverKind::volume;
  for (const Vec3f& camera : cameras) {
    const Vec3f to_camera = camera - receiver.position;
    const float distance_m = length(to_camera);
    if (!(distance_m > 0)) continue;
    const Vec3f direction = to_camera / distance_m;
    const auto is_same = [&](const Vec3f& v) { return dot(v, -direction) > kSameView; };
    if (std::any_of(views.begin(), views.end(), is_same)) continue;
    if (on_surface && !(dot(direction, receiver.normal) > 0)) continue;
    const Vec3f origin =
        on_surface ? offsetOrigin(pointWithoutTriangle(receiver.position, embree.extent()),
                                  receiver.normal, receiver.normal)
                   : receiver.position;
    if (!embree.occluded(Ray{origin, 0, direction, distance_m * (1 - kLightGap)}))
      views.push_back(-direction);
  }
  return views;
}

bool hasActiveProbe(const FieldSnapshot& field) {
  if (field.interpolant == PL_INTERPOLANT_SCATTERED) return !field.influence.entries.empty();
  return std::any_of(field.probe_of_point.begin(), field.probe_of_point.end(),
                     [](int probe) { return probe >= 0; });
}

// Points, power, noise and mean of the chosen receivers.
void addPoints(FrozenState& state, const std::vector<const Receiver*>& chosen,
               std::span<const Vec3f> cameras, const EmbreeScene& embree) {
  const std::vector<double> sigma = pooledSigma(chosen);
  double area = 0;
  for (const Receiver* r : chosen) area += r->area;
  double difference = 0;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const Receiver& r = *chosen[i];
    const double a = luminance(Vec3d(r.a)), b = luminance(Vec3d(r.b)), weight = r.area / area;
    state.power += weight * a * b;
    state.mean += weight * (a + b) / 2;
    difference += weight * (a - b) * (a - b) / 4;
    const std::vector<Vec3f> views = viewsOf(r, cameras, embree);
    for (const Vec3f& view : views)
      state.points.push_back({{r.position, r.normal, view},
                              (a + b) / 2,
                              weight / static_cast<double>(views.size()),
                              sigma[i],
                              false});
  }
  if (!(state.power > 0) || !(state.mean > 0))
    throwInput(
        "{}, state {}: no indirect light arrives at the {} receivers; tune under a lighting "
        "state with light",
        state.scene, state.state, chosen.size());
  state.noise = difference / state.power;
  for (TunePoint& p : state.points) p.dark = p.truth < kDark * state.mean;
}

}  // namespace

FrozenState freezeState(FieldSnapshot field, const Receivers& receivers, Split split,
                        std::span<const Vec3f> cameras, const EmbreeScene& embree) {
  FrozenState state;
  state.scene = receivers.scene_path;
  state.state = receivers.state;
  std::vector<const Receiver*> chosen;
  for (const Receiver& r : receivers.points)
    if (r.split == split && r.area > 0) chosen.push_back(&r);
  const char* part = split == Split::train ? "train" : "held-out";
  if (receivers.samples == 0)
    throwInput("{}: the receivers have no path-traced truth yet", state.scene);
  if (chosen.empty())
    throwInput("{}: none of the {} receivers is a {} one; take more with --count", state.scene,
               receivers.points.size(), part);
  if (!hasActiveProbe(field))
    throwInput("{}: no probe of the layout is active, so no parameter has an effect", state.scene);
  addPoints(state, chosen, cameras, embree);
  state.field = std::move(field);
  return state;
}

FrozenState freezeState(ProbeField& field, const Receivers& receivers, Split split,
                        std::span<const Vec3f> cameras, const EmbreeScene& embree) {
  return freezeState(takeSnapshot(field), receivers, split, cameras, embree);
}

}  // namespace probelab
