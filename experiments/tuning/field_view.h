// SPDX-License-Identifier: GPL-3.0-or-later
// A snapshot seen through the shared query with some of its texels answered otherwise: derive and
// hide a fetch function.
#pragma once

#include "ddgi/snapshot.h"

namespace probelab {

struct FieldView {
  const FieldSnapshot& field;

  int fetchProbe(int lattice_index) const { return field.fetchProbe(lattice_index); }
  int fetchNearest(int index) const { return field.fetchNearest(index); }
  uint32_t fetchVoxelBegin(int voxel) const { return field.fetchVoxelBegin(voxel); }
  VoxelEntry fetchEntry(uint32_t index) const { return field.fetchEntry(index); }
  int fetchPlaneOfVoxel(int voxel) const { return field.fetchPlaneOfVoxel(voxel); }
  const Vec4f& fetchPlane(int plane) const { return field.fetchPlane(plane); }
  Vec4f fetchPlace(int probe) const { return field.fetchPlace(probe); }
  const Vec3f& fetchPosition(int probe) const { return field.fetchPosition(probe); }
  const Vec3f& fetchIrradiance(int probe, int texel) const {
    return field.fetchIrradiance(probe, texel);
  }
  const Vec2f& fetchMoments(int probe, int texel) const { return field.fetchMoments(probe, texel); }
  float fetchAhead(int probe, int texel) const { return field.fetchAhead(probe, texel); }
};

// querySnapshot through a view.
template <class T, class View>
QueryResult<T> queryView(const View& view, const QueryParams<T>& params, const QueryModes& modes,
                         const QueryPoint& point) {
  const LatticeShape& lattice = view.field.lattice;
  const Vec3<T> position(point.position), normal(point.normal), direction(point.view);
  if (view.field.interpolant == PL_INTERPOLANT_SCATTERED)
    return queryScattered(view, params, modes, lattice, position, normal, direction);
  return queryLattice(view, params, modes, lattice, position, normal, direction);
}

// The modes of `params` for this field. Throws InputError where the field was made without what
// they read.
QueryModes viewModes(const FieldSnapshot& field, const Params& params);

}  // namespace probelab
