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
  std::vector<int> probe_of_point;
  std::vector<Vec3f> irradiance;
  std::vector<Vec2f> moments;

  int fetchProbe(int lattice_index) const {
    return probe_of_point[static_cast<std::size_t>(lattice_index)];
  }
  const Vec3f& fetchIrradiance(int probe, int x, int y) const {
    return irradiance[texelIndex(probe, x, y, lattice.irradiance_texels + 2)];
  }
  const Vec2f& fetchMoments(int probe, int x, int y) const {
    return moments[texelIndex(probe, x, y, lattice.moment_texels + 2)];
  }

 private:
  static std::size_t texelIndex(int probe, int x, int y, int side) {
    return (static_cast<std::size_t>(probe) * static_cast<std::size_t>(side) +
            static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(side) +
           static_cast<std::size_t>(x);
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
