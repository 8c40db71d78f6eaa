// SPDX-License-Identifier: Apache-2.0
// Ray proxies: a scene whose geometry is decimated within a bound in metres, for the rays of
// probes. Half-edge collapses of OpenMesh: a proxy's vertices are vertices of the scene, with their
// normals and texture coordinates, and no seam, border or change of material moves.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace probelab {

struct RayProxyOptions {
  // Hausdorff distance between a mesh and its proxy, both ways, in metres; by proxyErrorBound.
  // 0 removes only what lies exactly in a plane.
  double max_error_m = 0;
  // How far an interpolated shading normal may turn at the vertices that go. Raise it for more
  // speed where highlights do not matter; textures and flat faces are not affected.
  double max_normal_turn_rad = 0.2618;  // 15 degrees
  // The longest edge of a new triangle, as a share of the diagonal of the geometry's box. Faces
  // that span a room overlap in the ray tracer's tree: two triangles a wall trace at 0.6 to 0.8
  // times the speed of a hundred (Embree 3.13). Infinity for the fewest triangles.
  double max_edge_share = 0.05;
  // How much of an emitter's area may come or go.
  double max_emitter_area_change = 0.01;
  uint64_t seed = 0;  // of the points at which the error is measured
};

struct ProxyLeftAlone {
  std::string mesh;  // as MeshRange::name
  uint32_t triangles = 0;
  std::string reason;
};

// Distances in metres, the largest over all meshes, each mesh against its own proxy. Measured at
// every vertex, edge midpoint (of the proxy) and centroid, and at 2 random points a triangle.
struct RayProxyReport {
  uint32_t triangles_before = 0, triangles_after = 0;
  double max_error_m = 0;          // asked for
  double original_to_proxy_m = 0;  // from points of the scene
  double proxy_to_original_m = 0;  // from points of the proxy
  double emitter_area_before_m2 = 0, emitter_area_after_m2 = 0;
  double build_s = 0;
  std::vector<ProxyLeftAlone> left_alone;  // meshes that kept every triangle
};

struct RayProxy {
  Scene scene;
  RayProxyReport report;
};

// The scene with fewer triangles; everything but Scene::geometry is as it was. Triangles keep their
// order, material and mesh range. Each run of a mesh range's triangles of one material is decimated
// by itself, so borders, edges between materials and meshes, and edges that are not manifold stay
// as they are; degenerate triangles do too. A texture is displaced along the surface by at most
// max_error_m at the vertices that go. A mesh whose measured error or emitter area exceeds what was
// asked for is done again with a smaller tolerance, and left alone when that does not help.
// The same scene and options give the same bytes. Throws InputError when max_error_m is negative
// or not finite, another option is negative or NaN, or a material index is out of range.
RayProxy makeRayProxy(const Scene& scene, const RayProxyOptions& options);

// The bound to ask for: `requested_m`, but at most a quarter of the thinnest wall (infinity where
// there is none), so that two faces of a wall that approach each other stay half of it apart.
// Throws InputError when requested_m is negative or not finite, or the wall is negative or NaN.
double proxyErrorBound(double requested_m, double thinnest_wall_m);

}  // namespace probelab
