// SPDX-License-Identifier: GPL-3.0-or-later
// Fields made on the host for tests of the tuning: two rooms with a door, moments from Embree's
// rays, irradiance from a formula.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/rng.h"
#include "scattered_helpers.h"
#include "scene_builders.h"
#include "trace/embree_scene.h"
#include "tuning/frozen_state.h"
#include "tuning/objective.h"

namespace probelab::test {

// 4 x 2.5 x 3 m, divided at x = 2 by a wall of 10 cm that leaves a door at z > 2.
inline Scene twoRooms() {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f));
  builder.box(Vec3f(0), Vec3f(4, 2.5f, 3), m, true);
  builder.box(Vec3f(1.95f, 0, 0), Vec3f(2.05f, 2.5f, 2), m, false);
  return builder.finish();
}

struct RoomScene {
  Scene scene = twoRooms();
  EmbreeScene embree{scene};
  Box3f box{Vec3f(0), Vec3f(4, 2.5f, 3)};
};

inline const RoomScene& room() {
  static const RoomScene scene;
  return scene;
}

inline ProbeLayout roomLattice(const RoomScene& room, const Vec3i& count = Vec3i(5, 3, 4)) {
  const Box3f inner{room.box.min + Vec3f(0.25f), room.box.max - Vec3f(0.25f)};
  const Lattice lattice = makeLattice(inner, count);
  return latticeLayout(lattice, room.box,
                       std::vector<uint8_t>(static_cast<std::size_t>(lattice.pointCount()), 1));
}

inline ProbeLayout roomScattered(const RoomScene& room) {
  const Box3f inner{room.box.min + Vec3f(0.2f), room.box.max - Vec3f(0.2f)};
  return randomScattered(inner, 60, Vec3i(9, 6, 7), room.box, 3);
}

// Bright in one room, dim in the other, brighter from above.
inline Vec3f roomRadiance(const Vec3f& p, const Vec3f& n) {
  const float room = p.x < 2 ? 1.0f : 0.05f;
  const float e = room * (1 + 0.5f * n.y) * (1 + 0.3f * std::sin(2 * p.z) + 0.2f * p.y);
  return {e, 0.9f * e, 0.8f * e};
}

// `visit` gets probe, texel in the tile and the direction that it stands for, borders included.
template <class Visit>
void forTexels(const FieldSnapshot& snapshot, int interior, const Visit& visit) {
  const int border = snapshot.lattice.border, side = interior + 2 * border;
  for (std::size_t probe = 0; probe < snapshot.positions.size(); ++probe)
    for (int y = -border; y < interior + border; ++y)
      for (int x = -border; x < interior + border; ++x) {
        // A border texel is the interior one that tileTexel continues the map with.
        const int inside = tileTexel(x, y, interior, 0);
        const Vec3f d =
            texelDirection(static_cast<float>(inside % interior),
                           static_cast<float>(inside / interior), static_cast<float>(interior));
        visit(probe, static_cast<std::size_t>((y + border) * side + x + border), d);
      }
}

inline void fillRoom(FieldSnapshot& snapshot, const RoomScene& room, const Params& params) {
  const float gamma = static_cast<float>(1 / params.encoding_gamma);
  forTexels(snapshot, snapshot.lattice.irradiance_texels,
            [&](std::size_t probe, std::size_t, const Vec3f& n) {
              const Vec3f e = roomRadiance(snapshot.positions[probe], n);
              snapshot.irradiance.push_back(
                  {std::pow(e.x, gamma), std::pow(e.y, gamma), std::pow(e.z, gamma)});
            });
  Rng rng(1, RngStream::test, 30);
  const float reach = 1.5f * snapshot.lattice.support_radius;
  forTexels(snapshot, snapshot.lattice.moment_texels,
            [&](std::size_t probe, std::size_t, const Vec3f& n) {
              double mean = 0, square = 0;
              constexpr int kRays = 32;
              for (int i = 0; i < kRays; ++i) {
                const Vec3f d = normalize(n + randomUnit(rng) * 0.2f);
                const Hit hit = room.embree.closest(Ray{snapshot.positions[probe], 0, d, reach});
                const double t =
                    static_cast<double>(std::min(hit.t, reach) / snapshot.lattice.support_radius);
                mean += t / kRays, square += t * t / kRays;
              }
              snapshot.moments.emplace_back(static_cast<float>(mean), static_cast<float>(square));
            });
}

inline FieldSnapshot roomSnapshot(const RoomScene& room, const ProbeLayout& layout,
                                  const Params& params) {
  FieldSnapshot snapshot = layoutSnapshot(layout, initialStates(layout), params);
  fillRoom(snapshot, room, params);
  return snapshot;
}

// Places on walls as seen from the rooms, a third of them in free space.
inline std::vector<QueryPoint> roomPoints(const RoomScene& room, int count, uint64_t seed) {
  Rng rng(seed, RngStream::test, 31);
  std::vector<QueryPoint> points;
  const Vec3f eyes[] = {Vec3f(0.8f, 1.5f, 2.6f), Vec3f(3.3f, 1.3f, 0.6f)};
  while (points.size() < static_cast<std::size_t>(count)) {
    const Vec3f from = randomIn(rng, room.box), d = randomUnit(rng);
    if (from.x > 1.95f && from.x < 2.05f) continue;
    const Hit hit = room.embree.closest(Ray{from, 0, d, 100});
    if (!(hit.t < 50)) continue;
    QueryPoint point{from, -d, d};
    if (points.size() % 3 != 0) {
      point.position = from + d * hit.t;
      const Vec3f p = point.position;
      const Vec3f faces[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
      point.normal = Vec3f(0);
      for (const Vec3f& axis : faces)
        for (const float plane : {dot(axis, room.box.min), dot(axis, room.box.max), 1.95f, 2.05f})
          if (std::abs(dot(axis, p) - plane) < 1e-4f &&
              (plane < 1.9f || plane > 2.1f || axis.x > 0))
            point.normal = axis * (dot(axis, d) > 0 ? -1.0f : 1.0f);
      if (length(point.normal) < 0.5f) continue;
    }
    point.view = normalize(point.position - eyes[points.size() % 2]);
    points.push_back(point);
  }
  return points;
}

// Equal weights; the truth is what the query answers under `truth`.
inline FrozenState stateOf(FieldSnapshot field, const std::vector<QueryPoint>& points,
                           const Params& truth) {
  FrozenState state;
  state.scene = "two_rooms", state.state = "default";
  state.field = std::move(field);
  for (const QueryPoint& point : points)
    state.points.push_back({point, 0, 1 / static_cast<double>(points.size()), 0, false});
  const std::vector<double> values = queryPoints(state, truth);
  for (std::size_t i = 0; i < values.size(); ++i) {
    state.points[i].truth = values[i];
    state.power += state.points[i].weight * values[i] * values[i];
    state.mean += state.points[i].weight * values[i];
  }
  for (TunePoint& p : state.points) p.dark = p.truth < 0.1 * state.mean;
  return state;
}

inline std::vector<TunedKey> innerKeys(const std::vector<std::string>& names,
                                       const Params& params) {
  return tunedKeys(names, params).inner;
}

}  // namespace probelab::test
