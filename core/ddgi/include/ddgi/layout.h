// SPDX-License-Identifier: Apache-2.0
// Where the probes are and how a query weighs them. Positions are local (relative to
// Scene::origin), like every position.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "base/vec.h"
#include "ddgi/influence.h"
#include "ddgi/params.h"

namespace probelab {

// What the weights of the probes around a point come from. All but `lattice` are read through an
// InfluenceGrid.
enum class Interpolant {
  lattice,     // trilinear in the lattice's cell
  knn,         // the k nearest, falling to 0 at the support radius
  tetrahedra,  // barycentric in the Delaunay tetrahedron
  natural,     // natural neighbours (Sibson), sampled
  maxent,      // maximum entropy, centred on the point as far as that goes
  fitted,      // fitted to path-traced irradiance at train receivers
};
const char* interpolantName(Interpolant interpolant);
Interpolant parseInterpolant(const std::string& name);  // throws InputError

// A probe's two lengths in metres (DESIGN section 3).
struct ProbeLengths {
  float bias = 0;     // s_i
  float support = 0;  // r_i
};

struct ProbeLayout {
  std::string strategy;
  Interpolant interpolant = Interpolant::lattice;
  Box3f bounds;     // where the field answers: 1 inside, falling to 0 over one bias length outside
  Lattice lattice;  // with Interpolant::lattice
  std::vector<int> probe_of_point;    // [lattice point]: index of the stored probe, -1: none
  InfluenceGrid influence;            // with the others
  std::vector<Vec3f> positions;       // [stored probe]
  std::vector<ProbeLengths> lengths;  // [stored probe]; empty with a lattice: all the same
  std::vector<uint8_t> pinned;        // [stored probe], 1: no strategy may move it; or empty
  // Of the whole layout: a lattice's smallest spacing of an axis with more than one point and its
  // cell's diagonal; else the mean s_i and the largest r_i (the unit that moments are stored in).
  float bias_length_m = 0;
  float support_radius_m = 0;
  // Provenance.
  int asked = 0;  // budget N
  uint64_t seed = 0;
  std::map<std::string, std::string> options;  // as the strategy took them, defaults included
  uint64_t evaluations = 0;                    // layouts that were scored against truth
  double build_s = 0;
};

// A layout that stores the lattice points with keep[i] != 0.
ProbeLayout latticeLayout(const Lattice& lattice, const Box3f& bounds,
                          const std::vector<uint8_t>& keep);

// A layout of probes anywhere, with the influence that `corners` give them. s_i is the mean
// distance to the 6 nearest probes (fewer where there are fewer, for a single one the longest edge
// of the corners' box), r_i the distance at which the probe's weight reaches 0.
ProbeLayout scatteredLayout(Interpolant interpolant, std::vector<Vec3f> positions,
                            const Box3f& bounds, const Lattice& corners, CornerWeights weights,
                            const VoxelPieces& pieces = {});

// The query that reads the layout, PL_INTERPOLANT_*.
int queryInterpolant(const ProbeLayout& layout);

// The probe's lengths, whatever the layout.
ProbeLengths probeLengths(const ProbeLayout& layout, std::size_t probe);

// Throws InputError when a layout cannot be used: no stored probe, a zero or non-finite length or
// position, indices that do not fit, more texels than 2^31.
void validateLayout(const ProbeLayout& layout, const Params& params);
// The same without what depends on parameters; messages begin with `what`.
void validateLayout(const ProbeLayout& layout, const std::string& what);

LatticeShape latticeShape(const ProbeLayout& layout, const Params& params);

// Bytes of the index from places to stored probes.
uint64_t indexBytes(const ProbeLayout& layout);

}  // namespace probelab
