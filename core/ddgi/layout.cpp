// SPDX-License-Identifier: Apache-2.0
#include "ddgi/layout.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace probelab {

Vec3f Lattice::position(int index) const {
  const Vec3f step(static_cast<float>(index % count.x),
                   static_cast<float>(index / count.x % count.y),
                   static_cast<float>(index / (count.x * count.y)));
  return first + step * spacing;
}

Lattice makeLattice(const Box3f& box, const Vec3i& count) {
  Lattice lattice;
  lattice.count = count;
  const Vec3f edge = box.extent();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    PROBELAB_CHECK(count[axis] >= 1 && edge[axis] > 0);
    if (count[axis] == 1) {
      lattice.first[axis] = 0.5f * (box.min[axis] + box.max[axis]);
      lattice.spacing[axis] = edge[axis];
    } else {
      lattice.first[axis] = box.min[axis];
      lattice.spacing[axis] = edge[axis] / static_cast<float>(count[axis] - 1);
    }
  }
  return lattice;
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

void validateLayout(const ProbeLayout& layout, const Params& params) {
  if (layout.positions.empty())
    throwInput(
        "{}: the layout stores no probe: none of its points lies in reachable free space; "
        "ask for more probes or check the volume",
        layout.strategy);
  if (layout.probe_of_point.size() != static_cast<std::size_t>(layout.lattice.pointCount()))
    throwInput("{}: the index has {} entries for {} lattice points", layout.strategy,
               layout.probe_of_point.size(), layout.lattice.pointCount());
  const auto usable = [](float length) { return std::isfinite(length) && length > 0; };
  if (!usable(layout.bias_length_m) || !usable(layout.support_radius_m))
    throwInput("{}: probes coincide (spacing {} m); ask for fewer probes or a larger volume",
               layout.strategy, layout.bias_length_m);
  const uint64_t side = static_cast<uint64_t>(
      std::max(params.irradiance_texels, params.visibility ? params.moment_texels : 0));
  if (layout.positions.size() * side * side * 4 >= (uint64_t{1} << 31))
    throwInput("{}: {} probes with {} x {} texels are more than an atlas can index; use fewer",
               layout.strategy, layout.positions.size(), side, side);
}

LatticeShape latticeShape(const ProbeLayout& layout, const Params& params) {
  LatticeShape shape{};
  shape.first = layout.lattice.first;
  shape.bias_length = layout.bias_length_m;
  shape.spacing = layout.lattice.spacing;
  shape.support_radius = layout.support_radius_m;
  shape.bounds_min = layout.bounds.min;
  shape.bounds_max = layout.bounds.max;
  shape.count_x = layout.lattice.count.x;
  shape.count_y = layout.lattice.count.y;
  shape.count_z = layout.lattice.count.z;
  const AtlasSides sides = atlasSides(params);
  shape.irradiance_texels = sides.irradiance;
  shape.moment_texels = sides.moments;
  shape.border = sides.border;
  return shape;
}

uint64_t indexBytes(const ProbeLayout& layout) {
  return layout.probe_of_point.size() * sizeof(int);
}

}  // namespace probelab
