// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/report.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "base/timer.h"
#include "placement/free_space.h"
#include "placement/nearest_probes.h"
#include "visible_probes.h"
#ifdef PROBELAB_WITH_CGAL
#include "placement/distance.h"
#endif

namespace probelab {
namespace {

Spread spreadOf(const std::vector<double>& values) {
  return {percentile(values, 0), percentile(values, 0.05), percentile(values, 0.5),
          percentile(values, 0.95), percentile(values, 1)};
}

// The cell of a lattice around p, clamped to its outermost points, and the place in it.
struct Cell {
  Vec3i low;
  Vec3f share;  // from low to the next point, 0 on an axis with a single one
};

Cell cellAt(const Lattice& lattice, const Vec3f& p) {
  Cell cell;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int last = lattice.count[axis] - 1;
    if (last == 0) continue;
    const float at = std::clamp((p[axis] - lattice.first[axis]) / lattice.spacing[axis], 0.0f,
                                static_cast<float>(last));
    cell.low[axis] = std::min(static_cast<int>(at), last - 1);
    cell.share[axis] = at - static_cast<float>(cell.low[axis]);
  }
  return cell;
}

float cornerShare(const Cell& cell, int corner) {
  float weight = 1;
  for (std::size_t axis = 0; axis < 3; ++axis)
    weight *= (corner >> axis & 1) ? cell.share[axis] : 1 - cell.share[axis];
  return weight;
}

std::vector<CornerWeight> latticeWeights(const ProbeLayout& layout, const Vec3f& p) {
  const Cell cell = cellAt(layout.lattice, p);
  const Vec3i n = layout.lattice.count;
  std::vector<CornerWeight> weights;
  for (int k = 0; k < 8; ++k) {
    const float weight = cornerShare(cell, k);
    if (!(weight > 0)) continue;
    const Vec3i at = cell.low + Vec3i(k & 1, k >> 1 & 1, k >> 2);
    const int probe =
        layout.probe_of_point[static_cast<std::size_t>((at.z * n.y + at.y) * n.x + at.x)];
    if (probe >= 0) weights.push_back({static_cast<uint32_t>(probe), weight});
  }
  return weights;
}

std::vector<CornerWeight> voxelWeights(const InfluenceGrid& grid, const Vec3f& p) {
  const VoxelPlace place = voxelAt(grid.corners, grid.pieces, p);
  std::vector<CornerWeight> weights;
  for (uint32_t e = grid.voxel_begin[place.piece]; e < grid.voxel_begin[place.piece + 1]; ++e) {
    float weight = 0;
    for (std::size_t k = 0; k < 8; ++k)
      weight += place.share[k] * byteWeight(grid.entries[e].weights[k]);
    if (weight > 0) weights.push_back({grid.entries[e].probe, weight});
  }
  return weights;
}

void fillReached(LayoutReport& report, const ProbeLayout& layout, const EmbreeScene& embree,
                 std::span<const Vec3f> points) {
  if (points.empty()) return;
  std::vector<int> seen(points.size());
  parallelFor(points.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (const CornerWeight& w : weightsAt(layout, points[i]))
        if (seesPlace(embree, layout.positions[w.probe], points[i])) ++seen[i];
  });
  const auto total = static_cast<double>(points.size());
  for (std::size_t i = 0; i < LayoutReport::kReached.size(); ++i) {
    const int least = LayoutReport::kReached[i];
    const auto count = std::ranges::count_if(
        seen, [&](int probes) { return least == 0 ? probes == 0 : probes >= least; });
    report.reached[i] = static_cast<double>(count) / total;
  }
}

void fillDistances(LayoutReport& report, const ProbeLayout& layout, const Scene& scene) {
  const std::size_t count = layout.positions.size();
  std::vector<double> spacing(count);
  const NearestProbes probes(layout.positions);
  parallelFor(count, 64, [&](std::size_t begin, std::size_t end) {
    std::vector<NearProbe> near;
    for (std::size_t i = begin; i < end; ++i) {
      probes.nearest(layout.positions[i], 2, near);
      spacing[i] = static_cast<double>(near.back().distance_m);
    }
  });
  report.spacing_m = spreadOf(spacing);
#ifdef PROBELAB_WITH_CGAL
  report.has_clearance = !scene.geometry->triangles.empty();
  if (!report.has_clearance) return;
  const SceneDistance distance(*scene.geometry);
  std::vector<double> clearance(count);
  parallelFor(count, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      clearance[i] = distance.clearance(layout.positions[i]);
  });
  report.clearance_m = spreadOf(clearance);
#else
  (void)scene;
#endif
}

}  // namespace

std::vector<CornerWeight> weightsAt(const ProbeLayout& layout, const Vec3f& p) {
  return layout.interpolant == Interpolant::lattice ? latticeWeights(layout, p)
                                                    : voxelWeights(layout.influence, p);
}

LayoutReport layoutReport(const ProbeLayout& layout, const Scene& scene, const EmbreeScene& embree,
                          std::span<const Vec3f> points) {
  LayoutReport report;
  report.stored = layout.positions.size();
  for (const Vec3f& p : layout.positions)
    if (isInsideSolid(scene, embree, p)) ++report.inside_geometry;
  report.pinned = static_cast<uint64_t>(std::ranges::count(layout.pinned, uint8_t{1}));
  report.index_bytes = indexBytes(layout);
  report.build_s = layout.build_s;
  report.evaluations = layout.evaluations;
  if (layout.positions.empty()) return report;
  fillDistances(report, layout, scene);
  fillReached(report, layout, embree, points);
  return report;
}

}  // namespace probelab
