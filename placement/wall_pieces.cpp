// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/wall_pieces.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "base/interrupt.h"
#include "base/parallel.h"
#include "base/rng.h"
#include "trace/surface.h"
#include "visible_probes.h"

namespace probelab {
namespace {

constexpr int kAnEdge = 4;              // samples within a voxel along an edge
constexpr int kOnEdge = 3;              // and over its faces, edges and corners
constexpr float kInset = 1e-3f;         // of a voxel, of these from its surface
constexpr std::size_t kNearCorner = 2;  // places of a piece that stand for it at a corner
constexpr std::size_t kNearFace = 25;   // places of a piece that look through a face
constexpr float kShort = 2e-3f;         // of a voxel: what a corner's lines leave out there
constexpr int kPlanes = 24;             // pairs of places whose surfaces are tried as a plane

struct Piece {
  std::vector<Vec3f> places;
};
// What a voxel is made of: one piece, or the two sides of a plane.
struct Voxel {
  std::vector<Piece> pieces;  // none: solid
  std::optional<Vec4f> plane;
};

class Sets {  // disjoint
 public:
  explicit Sets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  std::size_t find(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) {
    a = find(a), b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

Vec3i placeOf(const Vec3i& count, std::size_t index) {
  const int i = static_cast<int>(index);
  return {i % count.x, i / count.x % count.y, i / (count.x * count.y)};
}

// All over a voxel, and all over its surface: a wall that runs close to a face leaves a sliver on
// the other side, which samples within would miss.
std::vector<Vec3f> voxelSamples(const Lattice& corners, const Vec3i& at, std::size_t voxel) {
  std::vector<Vec3f> samples;
  Rng rng(voxel, RngStream::placement, 40);
  const auto add = [&](const Vec3f& share) {
    samples.push_back(corners.first + (Vec3f(at) + share) * corners.spacing);
  };
  for (int i = 0; i < kAnEdge * kAnEdge * kAnEdge; ++i) {
    const Vec3i cell(i % kAnEdge, i / kAnEdge % kAnEdge, i / (kAnEdge * kAnEdge));
    const float x = rng.nextFloat(), y = rng.nextFloat(), z = rng.nextFloat();
    add((Vec3f(cell) + Vec3f(x, y, z)) / static_cast<float>(kAnEdge));
  }
  constexpr int kSteps = kOnEdge + 2;  // the first and the last lie on the surface
  for (int i = 0; i < kSteps * kSteps * kSteps; ++i) {
    const Vec3i step(i % kSteps, i / kSteps % kSteps, i / (kSteps * kSteps));
    Vec3f share;
    bool on_surface = false;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const bool low = step[axis] == 0, high = step[axis] == kSteps - 1;
      const float within = static_cast<float>(step[axis] - 1) + rng.nextFloat();
      share[axis] = low ? kInset : high ? 1 - kInset : within / static_cast<float>(kOnEdge);
      on_surface |= low || high;
    }
    if (on_surface) add(share);
  }
  return samples;
}

// Groups of places that see each other by way of others; what is not usable is left out.
std::vector<Piece> seeingGroups(const std::vector<Vec3f>& samples, const FreeSpace& space) {
  std::vector<Piece> groups;
  for (const Vec3f& p : samples) {
    // What sees a usable place is usable.
    const bool open = std::ranges::any_of(
        groups, [&](const Piece& group) { return space.lineFree(p, group.places.front()); });
    if (!open && !space.usable(p)) continue;
    std::vector<std::size_t> seen;
    for (std::size_t g = 0; g < groups.size(); ++g)
      if (std::ranges::any_of(groups[g].places,
                              [&](const Vec3f& q) { return space.lineFree(p, q); }))
        seen.push_back(g);
    if (seen.empty()) {
      groups.push_back({{p}});
      continue;
    }
    Piece& first = groups[seen.front()];
    first.places.push_back(p);
    for (std::size_t i = seen.size(); i-- > 1;) {
      const std::vector<Vec3f> more = std::move(groups[seen[i]].places);
      first.places.insert(first.places.end(), more.begin(), more.end());
      groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(seen[i]));
    }
  }
  return groups;
}

float sideOf(const Vec4f& plane, const Vec3f& p) {
  return dot(Vec3f(plane.x, plane.y, plane.z), p) + plane.w;
}

// The plane half-way between the surfaces that a and b see of the wall between them.
std::optional<Vec4f> planeBetween(const PlacementInput& input, const Vec3f& a, const Vec3f& b,
                                  const Vec3f& origin) {
  const EmbreeScene& embree = input.embree;
  const Vec3f way = b - a;
  const float distance_m = length(way);
  if (!(distance_m > 0)) return std::nullopt;
  const Vec3f d = way / distance_m;
  const Hit there = embree.closest(Ray{a, 0, d, distance_m});
  const Hit back = embree.closest(Ray{b, 0, -d, distance_m});
  if (there.primitive == kNoHit || back.primitive == kNoHit) return std::nullopt;
  Vec3f n = normalize(faceNormal(*input.scene.geometry, there.primitive));
  if (dot(n, d) > 0) n = -n;
  const Vec3f middle = (a + d * there.t + (b - d * back.t)) * 0.5f;
  return Vec4f(n.x, n.y, n.z, -dot(n, middle - origin));
}

// A plane that has all of `front` before it and all of `back` behind.
std::optional<Vec4f> separatingPlane(const Piece& front, const Piece& back, const FreeSpace& space,
                                     const Vec3f& origin) {
  const auto separates = [&](const Vec4f& plane) {
    return std::ranges::all_of(front.places,
                               [&](const Vec3f& p) { return sideOf(plane, p - origin) > 0; }) &&
           std::ranges::all_of(back.places,
                               [&](const Vec3f& p) { return sideOf(plane, p - origin) < 0; });
  };
  for (int i = 0; i < kPlanes; ++i) {
    const auto n = static_cast<std::size_t>(i);
    const Vec3f& a = front.places[(n * 7) % front.places.size()];
    const Vec3f& b = back.places[(n * 5) % back.places.size()];
    const std::optional<Vec4f> plane = planeBetween(space.input(), a, b, origin);
    if (plane && separates(*plane)) return plane;
  }
  return std::nullopt;
}

// A place on a sheet would see both of its sides; others of its piece stand for it.
void leaveSheet(Voxel& voxel, float extent_m, const Vec3f& origin) {
  for (Piece& piece : voxel.pieces) {
    const auto on_sheet = [&](const Vec3f& p) {
      return std::abs(sideOf(*voxel.plane, p - origin)) < 2 * kOnSurface * extent_m;
    };
    if (!std::ranges::all_of(piece.places, on_sheet)) std::erase_if(piece.places, on_sheet);
  }
}

Voxel lookAtVoxel(const Lattice& corners, const Vec3i& at, std::size_t index,
                  const FreeSpace& space) {
  Voxel voxel;
  voxel.pieces = seeingGroups(voxelSamples(corners, at, index), space);
  if (voxel.pieces.size() == 2)
    voxel.plane = separatingPlane(voxel.pieces[0], voxel.pieces[1], space, corners.first);
  if (voxel.plane) leaveSheet(voxel, space.input().embree.extent(), corners.first);
  if (voxel.pieces.size() < 2 || voxel.plane) return voxel;
  Piece all;
  for (const Piece& piece : voxel.pieces)
    all.places.insert(all.places.end(), piece.places.begin(), piece.places.end());
  voxel.pieces = {std::move(all)};
  return voxel;
}

// The `count` places of a piece for which `distance` is least.
template <class Distance>
std::vector<Vec3f> nearestPlaces(const Piece& piece, std::size_t count, const Distance& distance) {
  std::vector<Vec3f> places = piece.places;
  std::stable_sort(places.begin(), places.end(), [&](const Vec3f& a, const Vec3f& b) {
    return distance(a) < distance(b);
  });
  places.resize(std::min(places.size(), count));
  return places;
}

bool anySees(const FreeSpace& space, const std::vector<Vec3f>& from, const std::vector<Vec3f>& to) {
  return std::ranges::any_of(from, [&](const Vec3f& a) {
    return std::ranges::any_of(to, [&](const Vec3f& b) { return space.lineFree(a, b); });
  });
}

// [voxel][axis]: which pieces of it (rows) go together with those of the next one along the axis;
// bit 2 row + column.
using Passages = std::vector<std::array<uint8_t, 3>>;

Passages findPassages(const Lattice& corners, const std::vector<Voxel>& voxels,
                      const FreeSpace& space) {
  const Vec3i count = corners.count - Vec3i(1, 1, 1);
  Passages passages(voxels.size());
  parallelFor(voxels.size(), 32, [&](std::size_t begin, std::size_t end) {
    throwIfInterrupted();
    for (std::size_t v = begin; v < end; ++v)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const Vec3i at = placeOf(count, v);
        if (at[axis] + 1 >= count[axis]) continue;
        const std::size_t next = v + static_cast<std::size_t>(
                                         axis == 0 ? 1 : axis == 1 ? count.x : count.x * count.y);
        const float face =
            corners.first[axis] + static_cast<float>(at[axis] + 1) * corners.spacing[axis];
        const auto off = [&](const Vec3f& p) { return std::abs(p[axis] - face); };
        for (std::size_t a = 0; a < voxels[v].pieces.size(); ++a)
          for (std::size_t b = 0; b < voxels[next].pieces.size(); ++b)
            if (anySees(space, nearestPlaces(voxels[v].pieces[a], kNearFace, off),
                        nearestPlaces(voxels[next].pieces[b], kNearFace, off)))
              passages[v][axis] |= static_cast<uint8_t>(1u << (2 * a + b));
      }
  });
  return passages;
}

// One corner: its groups of pieces, each with the places that stand for it.
struct CornerGroups {
  std::vector<std::vector<Vec3f>> viewpoints;  // [group]; the first is that of the corner itself
  std::array<std::array<uint8_t, 2>, 8> group{};  // [voxel around][piece]
};

CornerGroups groupsAround(const Lattice& corners, const Vec3i& corner,
                          const std::vector<Voxel>& voxels, const Passages& passages,
                          const FreeSpace& space) {
  const Vec3i count = corners.count - Vec3i(1, 1, 1);
  // Voxel j of those around lies at corner - 1 + (j & 1, j >> 1 & 1, j >> 2).
  std::array<int, 8> around;
  for (int j = 0; j < 8; ++j) {
    const Vec3i at = corner + Vec3i((j & 1) - 1, (j >> 1 & 1) - 1, (j >> 2) - 1);
    const bool inside = at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < count.x && at.y < count.y &&
                        at.z < count.z;
    around[static_cast<std::size_t>(j)] = inside ? (at.z * count.y + at.y) * count.x + at.x : -1;
  }
  const auto voxelOf = [&](std::size_t j) -> const Voxel& {
    return voxels[static_cast<std::size_t>(around[j])];
  };
  Sets sets(17);  // piece p of voxel j: 2 j + p; 16: the corner itself
  for (std::size_t j = 0; j < 8; ++j)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t next = j | (std::size_t{1} << axis);
      if (next == j || around[j] < 0 || around[next] < 0) continue;
      const uint8_t open = passages[static_cast<std::size_t>(around[j])][axis];
      for (std::size_t bit = 0; bit < 4; ++bit)
        if ((open >> bit & 1) != 0) sets.join(2 * j + bit / 2, 2 * next + bit % 2);
    }
  const Vec3f p = corners.first + Vec3f(corner) * corners.spacing;
  const auto off = [&](const Vec3f& q) { return dot(q - p, q - p); };
  bool usable = space.usable(p);
  std::array<std::array<std::vector<Vec3f>, 2>, 8> near;
  std::vector<std::size_t> seen;
  // Up to what the test of a probe's visibility leaves out before its end (visible_probes.cpp).
  const float short_of_m = kShort * maxComponent(corners.spacing);
  const auto sees = [&](const Vec3f& q) {
    const Vec3f way = p - q;
    const float distance_m = length(way);
    return distance_m <= short_of_m ||
           !space.input().embree.occluded(
               Ray{q, 0, way / distance_m, distance_m - short_of_m});
  };
  for (std::size_t j = 0; j < 8; ++j)
    for (std::size_t a = 0; around[j] >= 0 && a < voxelOf(j).pieces.size(); ++a) {
      near[j][a] = nearestPlaces(voxelOf(j).pieces[a], kNearCorner, off);
      if (usable && std::ranges::any_of(near[j][a], sees)) seen.push_back(sets.find(2 * j + a));
    }
  // A corner on a sheet sees both of its sides, and stands for neither.
  std::ranges::sort(seen);
  usable = !seen.empty() && seen.front() == seen.back();
  if (usable) sets.join(seen.front(), 16);
  CornerGroups groups;
  std::vector<std::size_t> roots;
  if (usable) roots.push_back(sets.find(16)), groups.viewpoints.push_back({p});
  for (std::size_t j = 0; j < 8; ++j)
    for (std::size_t a = 0; around[j] >= 0 && a < voxelOf(j).pieces.size(); ++a) {
      const std::size_t root = sets.find(2 * j + a);
      const auto found = std::ranges::find(roots, root);
      const auto g = static_cast<std::size_t>(found - roots.begin());
      if (found == roots.end()) roots.push_back(root), groups.viewpoints.emplace_back();
      if (!(usable && g == 0)) groups.viewpoints[g].push_back(near[j][a].front());
      groups.group[j][a] = static_cast<uint8_t>(g);
    }
  return groups;
}

}  // namespace

WallPieces findWallPieces(const Lattice& corners, const FreeSpace& space) {
  const Vec3i count = corners.count - Vec3i(1, 1, 1);
  std::vector<Voxel> voxels(static_cast<std::size_t>(count.x) * static_cast<std::size_t>(count.y) *
                            static_cast<std::size_t>(count.z));
  parallelFor(voxels.size(), 16, [&](std::size_t begin, std::size_t end) {
    throwIfInterrupted();
    for (std::size_t v = begin; v < end; ++v)
      voxels[v] = lookAtVoxel(corners, placeOf(count, v), v, space);
  });
  const Passages passages = findPassages(corners, voxels, space);
  std::vector<CornerGroups> groups(static_cast<std::size_t>(corners.pointCount()));
  parallelFor(groups.size(), 32, [&](std::size_t begin, std::size_t end) {
    throwIfInterrupted();
    for (std::size_t c = begin; c < end; ++c)
      groups[c] = groupsAround(corners, placeOf(corners.count, c), voxels, passages, space);
  });

  WallPieces result;
  std::vector<uint32_t> second(groups.size());  // [corner]: its list of group 1
  result.viewpoints.resize(groups.size());
  for (std::size_t c = 0; c < groups.size(); ++c) {
    result.corner.push_back(static_cast<uint32_t>(c));
    if (!groups[c].viewpoints.empty()) result.viewpoints[c] = groups[c].viewpoints[0];
  }
  for (std::size_t c = 0; c < groups.size(); ++c) {
    second[c] = static_cast<uint32_t>(result.viewpoints.size());
    for (std::size_t g = 1; g < groups[c].viewpoints.size(); ++g) {
      result.viewpoints.push_back(groups[c].viewpoints[g]);
      result.corner.push_back(static_cast<uint32_t>(c));
    }
  }
  VoxelPieces& pieces = result.pieces;
  const auto listsOf = [&](std::size_t v, std::size_t piece) {
    std::array<uint32_t, 8> lists{};
    for (int k = 0; k < 8; ++k) {
      const std::size_t c = voxelCorner(corners, v, k);
      // Seen from its corner k the voxel is the one opposite.
      const uint8_t g = groups[c].group[static_cast<std::size_t>(7 - k)][piece];
      lists[static_cast<std::size_t>(k)] =
          g == 0 ? static_cast<uint32_t>(c) : second[c] + static_cast<uint32_t>(g - 1);
    }
    return lists;
  };
  for (std::size_t v = 0; v < voxels.size(); ++v) {
    pieces.plane_of_voxel.push_back(-1);
    pieces.lists.push_back(listsOf(v, 0));
  }
  for (std::size_t v = 0; v < voxels.size(); ++v) {
    if (!voxels[v].plane) continue;
    pieces.plane_of_voxel[v] = static_cast<int32_t>(pieces.planes.size());
    pieces.planes.push_back(*voxels[v].plane);
    pieces.lists.push_back(listsOf(v, 1));
  }
  return result;
}

}  // namespace probelab
