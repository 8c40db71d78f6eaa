// SPDX-License-Identifier: Apache-2.0
#include "trace/receivers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/build_info.h"
#include "base/error.h"
#include "base/interrupt.h"
#include "base/rng.h"
#include "receiver_points.h"
#include "shared/light.h"
#include "trace/area_sampler.h"
#include "trace/sampling.h"
#include "trace/surface.h"

namespace probelab {
namespace {

constexpr double kSurfaceShare = 0.7;
// Tries a receiver before the reachable share counts as nothing.
constexpr uint64_t kTriesEach = 1000, kTriesForOne = 100000;

// Everything that decides where receivers may be.
struct Places {
  const Scene& scene;
  const EmbreeScene& embree;
  const Reachability& reachability;
  MaterialTable materials;

  int reachableRegion(const Vec3f& p) const {
    const int region = regionOf(reachability, embree, p);
    if (region < 0 || !reachability.regions[static_cast<std::size_t>(region)].reachable) return -1;
    return region;
  }
};

// From the nearest camera that sees the point (from the front, for surfaces), else -normal.
Vec3f viewOf(const Places& places, const Vec3f& origin, const Vec3f& normal, bool on_surface) {
  float best = std::numeric_limits<float>::infinity();
  Vec3f view = -normal;
  for (const Camera& camera : places.scene.cameras) {
    const Vec3f to_camera = camera.position - origin;
    const float distance_m = length(to_camera);
    if (!(distance_m < best) || !(distance_m > 0)) continue;
    const Vec3f direction = to_camera / distance_m;
    if (on_surface && !(dot(direction, normal) > 0)) continue;
    if (places.embree.occluded(Ray{origin, 0, direction, distance_m * (1 - kLightGap)})) continue;
    best = distance_m;
    view = -direction;
  }
  return view;
}

Vec3f randomUnit(Rng& rng) {
  const float a = rng.nextFloat(), b = rng.nextFloat();
  return sampleSphere({a, b});
}

// One try: a point of the mesh whose front (of a double-sided face: a random reachable side) lies
// in reachable space inside the bounds.
bool trySurface(const Places& places, const AreaSampler& areas, Rng& rng, Receiver& receiver) {
  const Geometry& geometry = *places.scene.geometry;
  const AreaSample s = areas.sample(rng);
  const bool back_first = rng.nextFloat() < 0.5f;
  if (isHole(geometry, places.materials, s.triangle, s.u, s.v)) return false;
  const Triangle& t = geometry.triangles[s.triangle];
  const BoundedPoint point =
      pointOnTriangle(geometry.positions[t.vertex[0]], geometry.positions[t.vertex[1]],
                      geometry.positions[t.vertex[2]], s.u, s.v);
  const Vec3f front = faceNormal(geometry, s.triangle);
  const bool double_sided = places.materials.materials[t.material].double_sided;
  for (int side = 0; side < (double_sided ? 2 : 1); ++side) {
    const Vec3f normal = double_sided && back_first == (side == 0) ? -front : front;
    const Vec3f lifted = offsetOrigin(point, normal, normal);
    const int region = places.reachableRegion(lifted);
    if (region < 0) continue;
    receiver.position = point.position;
    receiver.normal = normal;
    receiver.view = viewOf(places, lifted, normal, true);
    receiver.kind = ReceiverKind::surface;
    receiver.region = region;
    return true;
  }
  return false;
}

// Cells in which reachable space may lie: reachable ones, and occupied ones in their box.
std::vector<int32_t> volumeCells(const Reachability& reachability) {
  std::vector<int32_t> cells;
  const Vec3f margin = reachability.cell_size;
  const Box3f box{reachability.reachable_box.min - margin, reachability.reachable_box.max + margin};
  for (std::size_t i = 0; i < reachability.cell_region.size(); ++i) {
    const int32_t region = reachability.cell_region[i];
    const auto cell = static_cast<int32_t>(i);
    if (region >= 0 ? reachability.regions[static_cast<std::size_t>(region)].reachable
                    : box.contains(reachability.cellCenter(cell)))
      cells.push_back(cell);
  }
  return cells;
}

// One try: uniform in one of the cells (which have equal volumes), kept if it is reachable.
bool tryVolume(const Places& places, const std::vector<int32_t>& cells, Rng& rng,
               Receiver& receiver) {
  const Vec3f center = places.reachability.cellCenter(cells[rng.nextBelow(cells.size())]);
  Vec3f p;
  for (std::size_t axis = 0; axis < 3; ++axis)
    p[axis] = center[axis] + (rng.nextFloat() - 0.5f) * places.reachability.cell_size[axis];
  receiver.normal = randomUnit(rng);
  receiver.region = places.reachableRegion(p);
  if (receiver.region < 0) return false;
  receiver.position = p;
  receiver.view = viewOf(places, p, receiver.normal, false);
  receiver.kind = ReceiverKind::volume;
  return true;
}

// `count` receivers of one kind; try i has random numbers of its own.
template <class Try>
void collect(uint32_t count, uint64_t seed, ReceiverKind kind, const Scene& scene,
             const Try& try_one, std::vector<Receiver>& points) {
  const std::size_t wanted = points.size() + count;
  const uint64_t tries = kTriesEach * std::max<uint64_t>(count, 1000);
  const std::size_t before = points.size();
  for (uint64_t i = 0; points.size() < wanted; ++i) {
    throwIfInterrupted();
    if (i >= (points.size() == before ? kTriesForOne : tries))
      throwInput(
          "{}: no reachable {} for receivers; give a camera inside, or a point of the space "
          "that counts in [receivers] seeds, or a [volume] that fits it (space is divided into "
          "cells, and what is smaller than one is not seen); or turn faces whose fronts look into "
          "the solid",
          scene.path, kind == ReceiverKind::surface ? "surface" : "free space");
    Rng rng(seed, RngStream::receiver_position, static_cast<uint64_t>(kind), i);
    Receiver receiver;
    if (!try_one(rng, receiver)) continue;
    receiver.split = receiverSplit(scene.bounds, receiver.position);
    points.push_back(receiver);
  }
}

Receivers emptyReceivers(const Scene& scene, uint64_t seed) {
  Receivers receivers;
  receivers.scene_path = scene.path;
  receivers.scene_hash = scene.content_hash;
  receivers.state = scene.state;
  receivers.seed = seed;
  receivers.version = buildInfo().version;
  return receivers;
}

// Of the block that the place is in.
uint64_t blockHash(const Box3f& bounds, const Vec3f& p) {
  const double edge = static_cast<double>(bounds.diagonal()) / 16;
  uint64_t block[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double offset = static_cast<double>(p[axis]) - static_cast<double>(bounds.min[axis]);
    block[axis] = static_cast<uint64_t>(static_cast<int64_t>(std::floor(offset / edge)));
  }
  return hashCounters(0, RngStream::split, block[0], block[1], block[2]);
}

}  // namespace

Receivers generateReceivers(const Scene& scene, const EmbreeScene& embree,
                            const Reachability& reachability, uint32_t count, uint64_t seed) {
  if (count == 0) throwInput("receivers: the count must be positive");
  const FlushDenormals flush;
  const Places places{scene, embree, reachability, makeMaterialTable(scene)};
  Receivers receivers = emptyReceivers(scene, seed);
  const bool surfaces = !scene.geometry->triangles.empty();
  const auto on_surfaces =
      surfaces ? static_cast<uint32_t>(std::lround(kSurfaceShare * count)) : 0u;
  if (on_surfaces > 0) {
    const AreaSampler areas(*scene.geometry);
    collect(
        on_surfaces, seed, ReceiverKind::surface, scene,
        [&](Rng& rng, Receiver& r) { return trySurface(places, areas, rng, r); }, receivers.points);
  }
  if (on_surfaces < count) {
    const std::vector<int32_t> cells = volumeCells(reachability);
    collect(
        count - on_surfaces, seed, ReceiverKind::volume, scene,
        [&](Rng& rng, Receiver& r) { return !cells.empty() && tryVolume(places, cells, rng, r); },
        receivers.points);
  }
  for (Receiver& r : receivers.points) {
    const bool surface = r.kind == ReceiverKind::surface;
    const uint32_t same = surface ? on_surfaces : count - on_surfaces;
    // With one kind alone (no triangles, or a count of 1) its weights sum to 1.
    const double share = same == count ? 1.0 : (surface ? kSurfaceShare : 1 - kSurfaceShare);
    r.area = share / same;
  }
  return receivers;
}

void placePoints(Receivers& receivers, const Scene& scene, const EmbreeScene& embree,
                 const Reachability& reachability) {
  const FlushDenormals flush;
  for (Receiver& r : receivers.points) {
    r.area = 1.0 / static_cast<double>(receivers.points.size());
    r.kind = ReceiverKind::point;
    r.split = Split::heldout;
    r.view = -r.normal;
    const BoundedPoint point = pointWithoutTriangle(r.position, embree.extent());
    r.region = regionOf(reachability, embree, offsetOrigin(point, r.normal, r.normal));
  }
  const Receivers provenance = emptyReceivers(scene, 0);
  receivers.scene_path = provenance.scene_path;
  receivers.scene_hash = provenance.scene_hash;
  receivers.state = provenance.state;
  receivers.version = provenance.version;
}

void traceReceivers(Receivers& receivers, const Scene& scene, const EmbreeScene& embree,
                    const SampleBudget& budget, uint64_t seed,
                    const std::function<void(double)>& progress) {
  std::vector<IrradiancePoint> points;
  for (const Receiver& r : receivers.points) points.push_back({r.position, r.normal});
  const IrradianceEstimate estimate =
      estimateIrradiance(scene, embree, points, budget, seed, progress);
  for (std::size_t i = 0; i < points.size(); ++i) {
    receivers.points[i].a = estimate.a[i];
    receivers.points[i].b = estimate.b[i];
  }
  receivers.seed = seed;
  receivers.samples = estimate.samples;
  receivers.rel_error = estimate.rel_error;
  receivers.seconds = estimate.seconds;
  receivers.rays = estimate.rays.total();
}

Split receiverSplit(const Box3f& bounds, const Vec3f& p) {
  return (blockHash(bounds, p) & 1) != 0 ? Split::train : Split::heldout;
}

int receiverFold(const Box3f& bounds, const Vec3f& p, int folds) {
  return static_cast<int>((blockHash(bounds, p) >> 1) % static_cast<uint64_t>(folds));
}

const char* receiverKindName(ReceiverKind kind) {
  switch (kind) {
    case ReceiverKind::surface:
      return "surface";
    case ReceiverKind::volume:
      return "volume";
    default:
      return "point";
  }
}

}  // namespace probelab
