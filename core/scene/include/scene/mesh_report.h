// SPDX-License-Identifier: Apache-2.0
// What `probelab check` says of the geometry itself (edges on welded positions).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace probelab {

struct MeshEdges {
  std::string name;
  uint32_t triangles = 0;
  uint32_t boundary_edges = 0;      // used by one triangle
  uint32_t nonmanifold_edges = 0;   // used by three or more
  uint32_t inconsistent_edges = 0;  // two triangles that run along it in the same direction
  bool closed() const { return boundary_edges == 0; }
};

struct MeshReport {
  MeshEdges all;                 // the whole scene, welded together
  std::vector<MeshEdges> meshes; // each mesh of each node by itself, its primitives together
  uint32_t welded_vertices = 0;
  uint32_t degenerate_triangles = 0;  // left out on loading
  uint32_t duplicate_triangles = 0;   // same three welded vertices
};

// Vertices closer than 1e-6 of the box's diagonal count as one.
MeshReport reportMesh(const Scene& scene);

}  // namespace probelab
