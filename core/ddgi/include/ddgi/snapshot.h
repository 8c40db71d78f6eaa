// SPDX-License-Identifier: Apache-2.0
// A field copied to the host: the C++ side of the shared query.
#pragma once

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
  std::vector<int> probe_of_point, nearest_probe;  // [lattice point], active probes; -1: none
  std::vector<Vec3f> positions;                    // [probe]
  std::vector<Vec3f> irradiance;
  std::vector<Vec2f> moments;

  int fetchProbe(int lattice_index) const {
    return probe_of_point[static_cast<std::size_t>(lattice_index)];
  }
  int fetchNearest(int lattice_index) const {
    return nearest_probe[static_cast<std::size_t>(lattice_index)];
  }
  const Vec3f& fetchPosition(int probe) const { return positions[static_cast<std::size_t>(probe)]; }
  const Vec3f& fetchIrradiance(int probe, int texel) const {
    return irradiance[texelIndex(probe, texel, lattice.irradiance_texels)];
  }
  const Vec2f& fetchMoments(int probe, int texel) const {
    return moments[texelIndex(probe, texel, lattice.moment_texels)];
  }

 private:
  std::size_t texelIndex(int probe, int texel, int interior) const {
    const auto side = static_cast<std::size_t>(interior + 2 * lattice.border);
    return static_cast<std::size_t>(probe) * side * side + static_cast<std::size_t>(texel);
  }
};

FieldSnapshot takeSnapshot(ProbeField& field);

// The query that the device runs, on any scalar T (float, double, a Jet).
template <class T>
QueryResult<T> querySnapshot(const FieldSnapshot& field, const QueryParams<T>& params,
                             const QueryPoint& point) {
  return queryLattice(field, params, field.modes, field.lattice, Vec3<T>(point.position),
                      Vec3<T>(point.normal), Vec3<T>(point.view));
}

}  // namespace probelab
