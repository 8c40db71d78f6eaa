// SPDX-License-Identifier: Apache-2.0
// Meshes -> triangles in world coordinates, in double; and from there to the scene's Geometry.
#pragma once

#include <memory>
#include <vector>

#include "gltf_file.h"
#include "gltf_materials.h"
#include "gltf_nodes.h"
#include "scene/scene.h"

namespace probelab {

// No position may lie further from the world's origin, along any axis.
inline constexpr double kMaxCoordinate = 1e7;

// Attributes per vertex, as in Geometry.
struct WorldGeometry {
  std::vector<Vec3d> positions;
  std::vector<Vec3f> normals;
  std::vector<Vec2f> uv0, uv1;
  std::vector<Triangle> triangles;
  std::vector<MeshRange> meshes;
};

// Appends the meshes of the placed nodes. Throws InputError naming node and mesh.
WorldGeometry buildGeometry(const GltfFile& gltf, const std::vector<PlacedNode>& nodes,
                            GltfMaterials& materials, Warnings& warnings);

// Box of the vertices that triangles of non-zero area use; empty without any.
Box3d boxOf(const WorldGeometry& geometry);

// Relative to `origin`, in single precision. Leaves out triangles whose area is zero there (counted
// in dropped_degenerate and warned about) and no others; turns shading normals to the side that
// their faces look to.
std::shared_ptr<const Geometry> localGeometry(const std::string& file, WorldGeometry world,
                                              const Vec3d& origin, Warnings& warnings);

}  // namespace probelab
