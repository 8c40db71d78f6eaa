// SPDX-License-Identifier: Apache-2.0
#include "ddgi/layout.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/error.h"
#include "base/parallel.h"
#include "base/suggest.h"

namespace probelab {
namespace {

constexpr Interpolant kInterpolants[] = {Interpolant::lattice, Interpolant::knn,
                                         Interpolant::tetrahedra, Interpolant::natural,
                                         Interpolant::maxent,
                                         Interpolant::fitted};

// Mean distance to the nearest others, at most kNeighbours of them: outwards along the longest axis
// until no nearer one can follow.
constexpr std::size_t kNeighbours = 6;
std::vector<float> meanNeighbourDistances(const std::vector<Vec3f>& positions) {
  Box3f box;
  for (const Vec3f& p : positions) box.extend(p);
  std::size_t axis = 0;
  for (const std::size_t other : {1, 2})
    if (box.extent()[other] > box.extent()[axis]) axis = other;
  std::vector<std::size_t> order(positions.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return positions[a][axis] < positions[b][axis];
  });
  std::vector<float> means(positions.size(), 0);
  const std::size_t wanted = std::min(kNeighbours, positions.size() - 1);
  if (wanted == 0) return means;
  parallelFor(order.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t at = begin; at < end; ++at) {
      const Vec3f& p = positions[order[at]];
      std::vector<float> nearest;  // ascending, at most `wanted`
      // Whether a farther one along the axis may still count.
      const auto take = [&](std::size_t other) {
        const Vec3f& q = positions[order[other]];
        const float d = length(q - p);
        if (nearest.size() < wanted || d < nearest.back()) {
          if (nearest.size() == wanted) nearest.pop_back();
          nearest.insert(std::upper_bound(nearest.begin(), nearest.end(), d), d);
        }
        return nearest.size() < wanted || std::abs(q[axis] - p[axis]) < nearest.back();
      };
      for (std::size_t i = at; i-- > 0;)
        if (!take(i)) break;
      for (std::size_t i = at + 1; i < order.size(); ++i)
        if (!take(i)) break;
      const double sum = std::accumulate(nearest.begin(), nearest.end(), 0.0);
      means[order[at]] = static_cast<float>(sum / static_cast<double>(wanted));
    }
  });
  return means;
}

// Distance from each probe to the farthest corner of the voxels where it counts: there its
// trilinear weight reaches 0. Only voxels with a corner that `given` marks, where queries can come
// from.
std::vector<float> supportRadii(const InfluenceGrid& grid, const VoxelPieces& pieces,
                                const std::vector<Vec3f>& positions,
                                const std::vector<uint8_t>& given) {
  std::vector<float> radii(positions.size(), 0);
  const Vec3i voxels = grid.voxels();
  const auto reach = [&](std::size_t voxel, std::size_t piece) {
    bool reached = false;
    Box3f box;
    for (int k = 0; k < 8; ++k) {
      const std::size_t corner = voxelCorner(grid.corners, voxel, k);
      box.extend(grid.corners.position(static_cast<int>(corner)));
      reached = reached || given[pieces.lists.empty()
                                     ? corner
                                     : pieces.lists[piece][static_cast<std::size_t>(k)]] != 0;
    }
    if (!reached) return;
    for (uint32_t e = grid.voxel_begin[piece]; e < grid.voxel_begin[piece + 1]; ++e) {
      const Vec3f& p = positions[grid.entries[e].probe];
      float& radius = radii[grid.entries[e].probe];
      radius = std::max(radius, length(componentMax(p - box.min, box.max - p)));
    }
  };
  const std::size_t count = static_cast<std::size_t>(voxels.x) *
                            static_cast<std::size_t>(voxels.y) * static_cast<std::size_t>(voxels.z);
  for (std::size_t v = 0; v < count; ++v) {
    reach(v, v);
    if (pieces.any() && pieces.plane_of_voxel[v] >= 0)
      reach(v, count + static_cast<std::size_t>(pieces.plane_of_voxel[v]));
  }
  return radii;
}

void validateLatticePoints(const ProbeLayout& layout, const std::string& what) {
  const std::size_t points = layout.probe_of_point.size();
  if (points != static_cast<std::size_t>(layout.lattice.pointCount()))
    throwInput("{}: the index has {} entries for {} lattice points", what, points,
               layout.lattice.pointCount());
  std::vector<uint8_t> named(layout.positions.size(), 0);
  for (std::size_t i = 0; i < points; ++i) {
    const int probe = layout.probe_of_point[i];
    if (probe < -1 || probe >= static_cast<int>(layout.positions.size()))
      throwInput("{}: lattice point {}: probe {} of {}", what, i, probe, layout.positions.size());
    if (probe >= 0 && named[static_cast<std::size_t>(probe)]++ != 0)
      throwInput("{}: lattice point {}: probe {} is another point's already", what, i, probe);
  }
  const auto lost = std::ranges::find(named, 0);
  if (lost != named.end())
    throwInput("{}: probe {} is at no lattice point", what, lost - named.begin());
}

// Weights that follow moved probes need every probe strictly between its lattice neighbours, also
// after relocation.
void checkOffsets(const ProbeLayout& layout, const Params& params) {
  const double limit = 1 - (params.relocation != 0 ? params.relocation_limit : 0);
  for (std::size_t i = 0; i < layout.probe_of_point.size(); ++i) {
    if (layout.probe_of_point[i] < 0) continue;
    const auto probe = static_cast<std::size_t>(layout.probe_of_point[i]);
    const Vec3f share = (layout.positions[probe] - layout.lattice.position(static_cast<int>(i))) /
                        layout.lattice.spacing;
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (std::abs(static_cast<double>(share[axis])) >= limit)
        throwInput(
            "{}: probe {} lies {:.3g} spacings from its lattice point, must be below {:.3g} with "
            "offset_weights = \"moved\"; use \"lattice\"",
            layout.strategy, probe, std::abs(share[axis]), limit);
  }
}

}  // namespace

const char* interpolantName(Interpolant interpolant) {
  switch (interpolant) {
    case Interpolant::lattice:
      return "lattice";
    case Interpolant::knn:
      return "knn";
    case Interpolant::tetrahedra:
      return "tetrahedra";
    case Interpolant::natural:
      return "natural";
    case Interpolant::maxent:
      return "maxent";
    case Interpolant::fitted:
      return "fitted";
  }
  return "";
}

Interpolant parseInterpolant(const std::string& name) {
  std::vector<std::string> known;
  for (const Interpolant interpolant : kInterpolants) {
    if (name == interpolantName(interpolant)) return interpolant;
    known.emplace_back(interpolantName(interpolant));
  }
  throwInput("unknown interpolant '{}'{}", name, suggestion(name, known));
}

ProbeLayout latticeLayout(const Lattice& lattice, const Box3f& bounds,
                          const std::vector<uint8_t>& keep) {
  PROBELAB_CHECK_EQ(static_cast<int>(keep.size()), lattice.pointCount());
  ProbeLayout layout;
  layout.bounds = bounds;
  layout.lattice = lattice;
  for (int i = 0; i < lattice.pointCount(); ++i) {
    const bool stored = keep[static_cast<std::size_t>(i)] != 0;
    layout.probe_of_point.push_back(stored ? static_cast<int>(layout.positions.size()) : -1);
    if (stored) layout.positions.push_back(lattice.position(i));
  }
  float smallest = std::numeric_limits<float>::infinity();
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (lattice.count[axis] > 1) smallest = std::min(smallest, lattice.spacing[axis]);
  layout.bias_length_m = std::isfinite(smallest) ? smallest : minComponent(lattice.spacing);
  layout.support_radius_m = length(lattice.spacing);
  return layout;
}

ProbeLayout scatteredLayout(Interpolant interpolant, std::vector<Vec3f> positions,
                            const Box3f& bounds, const Lattice& corners, CornerWeights weights,
                            const VoxelPieces& pieces) {
  PROBELAB_CHECK(interpolant != Interpolant::lattice);
  if (positions.empty())
    throwInput("the layout stores no probe: ask for more probes or check the volume");
  std::vector<uint8_t> given;
  for (const auto& corner : weights)
    given.push_back(std::any_of(corner.begin(), corner.end(),
                                [](const CornerWeight& w) { return w.weight > 0; })
                        ? 1
                        : 0);
  ProbeLayout layout;
  layout.interpolant = interpolant;
  layout.bounds = bounds;
  layout.influence =
      makeInfluence(corners, std::move(weights), positions, pieces,
                    interpolant == Interpolant::fitted ? CornerScale::kept : CornerScale::one);
  layout.positions = std::move(positions);
  const std::vector<float> support = supportRadii(layout.influence, pieces, layout.positions, given);
  std::vector<float> bias = meanNeighbourDistances(layout.positions);
  if (bias.size() == 1)
    bias[0] = maxComponent(corners.spacing * Vec3f(corners.count - Vec3i(1, 1, 1)));
  double bias_sum = 0;
  for (std::size_t i = 0; i < layout.positions.size(); ++i) {
    // A probe that counts nowhere takes its bias length.
    layout.lengths.push_back({bias[i], support[i] > 0 ? support[i] : bias[i]});
    bias_sum += static_cast<double>(bias[i]);
    layout.support_radius_m = std::max(layout.support_radius_m, layout.lengths.back().support);
  }
  layout.bias_length_m =
      static_cast<float>(bias_sum / static_cast<double>(layout.positions.size()));
  return layout;
}

int queryInterpolant(const ProbeLayout& layout) {
  return layout.interpolant == Interpolant::lattice ? PL_INTERPOLANT_LATTICE
                                                    : PL_INTERPOLANT_SCATTERED;
}

ProbeLengths probeLengths(const ProbeLayout& layout, std::size_t probe) {
  if (layout.lengths.empty()) return {layout.bias_length_m, layout.support_radius_m};
  return layout.lengths[probe];
}

void validateLayout(const ProbeLayout& layout, const std::string& what) {
  if (layout.positions.empty())
    throwInput(
        "{}: the layout stores no probe: none of its points lies in reachable free space; "
        "ask for more probes or check the volume",
        what);
  const std::size_t probes = layout.positions.size();
  const auto usable = [](float length) { return std::isfinite(length) && length > 0; };
  if (!usable(layout.bias_length_m))
    throwInput(
        "{}: probes coincide (spacing {} m); move them apart, or ask for fewer or a larger volume",
        what, layout.bias_length_m);
  if (!usable(layout.support_radius_m))
    throwInput("{}: a support radius of {} m; it must be finite and above 0", what,
               layout.support_radius_m);
  for (std::size_t i = 0; i < probes; ++i)
    if (!isFinite(layout.positions[i]))
      throwInput("{}: the position of probe {} is not finite", what, i);
  if (!layout.pinned.empty() && layout.pinned.size() != probes)
    throwInput("{}: {} pins for {} probes", what, layout.pinned.size(), probes);
  if (layout.interpolant == Interpolant::lattice) {
    if (!layout.lengths.empty())
      throwInput("{}: probes of a lattice have no lengths of their own", what);
    validateLatticePoints(layout, what);
  } else {
    if (layout.lengths.size() != probes)
      throwInput("{}: {} lengths for {} probes", what, layout.lengths.size(), probes);
    for (std::size_t i = 0; i < probes; ++i) {
      if (!usable(layout.lengths[i].bias) || !usable(layout.lengths[i].support))
        throwInput("{}: probe {} coincides with others (lengths {} and {} m); move it away", what,
                   i, layout.lengths[i].bias, layout.lengths[i].support);
      if (layout.lengths[i].support > layout.support_radius_m)
        throwInput("{}: probe {}: its support of {} m is more than the layout's, {} m", what, i,
                   layout.lengths[i].support, layout.support_radius_m);
    }
    validateInfluence(layout.influence, probes, what);
  }
}

void validateLayout(const ProbeLayout& layout, const Params& params) {
  validateLayout(layout, layout.strategy);
  if (layout.interpolant == Interpolant::lattice && params.offset_weights != 0)
    checkOffsets(layout, params);
  const uint64_t side = static_cast<uint64_t>(
      std::max(params.irradiance_texels, params.visibility ? params.moment_texels : 0));
  const std::size_t probes = layout.positions.size();
  if (probes * side * side * 4 >= (uint64_t{1} << 31))
    throwInput("{}: {} probes with {} x {} texels are more than an atlas can index; use fewer",
               layout.strategy, probes, side, side);
}

LatticeShape latticeShape(const ProbeLayout& layout, const Params& params) {
  const bool on_lattice = layout.interpolant == Interpolant::lattice;
  const Lattice& lattice = on_lattice ? layout.lattice : layout.influence.corners;
  LatticeShape shape{};
  shape.first = lattice.first;
  shape.bias_length = layout.bias_length_m;
  shape.spacing = lattice.spacing;
  shape.support_radius = layout.support_radius_m;
  shape.bounds_min = layout.bounds.min;
  shape.bounds_max = layout.bounds.max;
  shape.count_x = lattice.count.x;
  shape.count_y = lattice.count.y;
  shape.count_z = lattice.count.z;
  const AtlasSides sides = atlasSides(params);
  shape.irradiance_texels = sides.irradiance;
  shape.moment_texels = sides.moments;
  shape.border = sides.border;
  return shape;
}

uint64_t indexBytes(const ProbeLayout& layout) {
  if (layout.interpolant != Interpolant::lattice) return influenceBytes(layout.influence);
  return layout.probe_of_point.size() * sizeof(int);
}

}  // namespace probelab
