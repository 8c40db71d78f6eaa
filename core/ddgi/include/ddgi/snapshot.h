// SPDX-License-Identifier: Apache-2.0
// A field copied to the host: the C++ side of the shared query.
#pragma once

#include <bit>
#include <cstddef>
#include <vector>

#include "ddgi/probe_field.h"
#include "shared/query.h"

namespace probelab {

// Plain data; texels as ProbeField::irradianceTexels and momentTexels.
struct FieldSnapshot {
  LatticeShape lattice{};
  QueryModes modes{};
  QueryParams<double> params;
  int interpolant = PL_INTERPOLANT_LATTICE;
  std::vector<int> probe_of_point;  // [lattice point], active probes; -1: none
  std::vector<int> nearest_probe;   // [lattice point or voxel piece], with the nearest fallback
  InfluenceGrid influence;          // with scattered probes
  std::vector<Vec3f> positions;     // [probe]
  std::vector<float> bias_lengths;  // [probe], with scattered probes
  std::vector<Vec3f> irradiance;
  std::vector<Vec2f> moments;

  int fetchProbe(int lattice_index) const {
    return probe_of_point[static_cast<std::size_t>(lattice_index)];
  }
  int fetchNearest(int index) const { return nearest_probe[static_cast<std::size_t>(index)]; }
  uint32_t fetchVoxelBegin(int voxel) const {
    return influence.voxel_begin[static_cast<std::size_t>(voxel)];
  }
  VoxelEntry fetchEntry(uint32_t index) const {
    return std::bit_cast<VoxelEntry>(influence.entries[index]);
  }
  int fetchPlaneOfVoxel(int voxel) const {
    return influence.pieces.plane_of_voxel[static_cast<std::size_t>(voxel)];
  }
  const Vec4f& fetchPlane(int plane) const {
    return influence.pieces.planes[static_cast<std::size_t>(plane)];
  }
  Vec4f fetchPlace(int probe) const {
    const Vec3f& p = fetchPosition(probe);
    return {p.x, p.y, p.z, bias_lengths[static_cast<std::size_t>(probe)]};
  }
  const Vec3f& fetchPosition(int probe) const { return positions[static_cast<std::size_t>(probe)]; }
  const Vec3f& fetchIrradiance(int probe, int texel) const {
    return irradiance[texelIndex(probe, texel, lattice.irradiance_texels)];
  }
  const Vec2f& fetchMoments(int probe, int texel) const {
    return moments[texelIndex(probe, texel, lattice.moment_texels)];
  }
  float fetchAhead(int probe, int texel) const { return fetchMoments(probe, texel).x; }

 private:
  std::size_t texelIndex(int probe, int texel, int interior) const {
    const auto side = static_cast<std::size_t>(interior + 2 * lattice.border);
    return static_cast<std::size_t>(probe) * side * side + static_cast<std::size_t>(texel);
  }
};

FieldSnapshot takeSnapshot(ProbeField& field);

// The same without texels, which the caller fills in.
FieldSnapshot layoutSnapshot(const ProbeLayout& layout, const ProbeStates& states,
                             const Params& params);

// The query that the device runs, on any scalar T (float, double, a Jet).
template <class T>
QueryResult<T> querySnapshot(const FieldSnapshot& field, const QueryParams<T>& params,
                             const QueryPoint& point) {
  const Vec3<T> position(point.position), normal(point.normal), view(point.view);
  if (field.interpolant == PL_INTERPOLANT_SCATTERED)
    return queryScattered(field, params, field.modes, field.lattice, position, normal, view);
  return queryLattice(field, params, field.modes, field.lattice, position, normal, view);
}

}  // namespace probelab
