// SPDX-License-Identifier: Apache-2.0
#include "proxy_decimate.h"

#include "proxy_modules.h"

namespace probelab {
namespace {

// The patch as a half-edge mesh. Faces that it does not take are kept aside, their vertices locked.
struct HalfEdgePatch {
  ProxyMesh mesh;
  std::vector<int> face_of;  // [face of the mesh] face of the patch
  std::vector<bool> locked;
};

// OpenMesh refuses a face with a third use of an edge or at a closed vertex, and says so on stderr;
// asking first keeps that quiet.
bool takesFace(const ProxyMesh& mesh, const std::array<ProxyMesh::VertexHandle, 3>& v) {
  for (std::size_t k = 0; k < 3; ++k) {
    if (!mesh.is_boundary(v[k])) return false;
    const auto edge = mesh.find_halfedge(v[k], v[(k + 1) % 3]);
    if (edge.is_valid() && !mesh.is_boundary(edge)) return false;
  }
  return true;
}

// Faces folded flat onto their neighbours hide what a turned face would tell.
void lockFolds(HalfEdgePatch& half_edge) {
  constexpr double kFoldCosine = -0.97;
  ProxyMesh& mesh = half_edge.mesh;
  for (const auto edge : mesh.edges()) {
    if (mesh.is_boundary(edge)) continue;
    const auto side = mesh.halfedge_handle(edge, 0), other = mesh.halfedge_handle(edge, 1);
    const double cosine =
        OpenMesh::dot(mesh.normal(mesh.face_handle(side)), mesh.normal(mesh.face_handle(other)));
    if (cosine > kFoldCosine) continue;
    half_edge.locked[static_cast<std::size_t>(mesh.to_vertex_handle(side).idx())] = true;
    half_edge.locked[static_cast<std::size_t>(mesh.to_vertex_handle(other).idx())] = true;
  }
}

void fillMesh(const Geometry& geometry, const Patch& patch, HalfEdgePatch& out) {
  ProxyMesh& mesh = out.mesh;
  mesh.request_vertex_status();
  mesh.request_halfedge_status();
  mesh.request_edge_status();
  mesh.request_face_status();
  mesh.request_face_normals();
  out.locked = patch.locked;
  for (const uint32_t position : patch.position) {
    const Vec3f& p = geometry.positions[position];
    mesh.add_vertex(OpenMesh::Vec3d(p.x, p.y, p.z));
  }
  for (std::size_t f = 0; f < patch.faces.size(); ++f) {
    if (patch.aside[f]) continue;
    std::array<ProxyMesh::VertexHandle, 3> v;
    for (std::size_t k = 0; k < 3; ++k)
      v[k] = ProxyMesh::VertexHandle(static_cast<int>(patch.faces[f][k]));
    if (takesFace(mesh, v) && mesh.add_face(v.data(), 3).is_valid()) {
      out.face_of.push_back(static_cast<int>(f));
    } else {
      for (const uint32_t vertex : patch.faces[f]) out.locked[vertex] = true;
    }
  }
  mesh.update_face_normals();
  lockFolds(out);
  for (const auto v : mesh.vertices())
    mesh.status(v).set_locked(out.locked[static_cast<std::size_t>(v.idx())] || mesh.is_boundary(v));
}

void decimateMesh(HalfEdgePatch& half_edge, const Geometry& geometry, const Patch& patch,
                  const DecimateSettings& settings, std::vector<Corners>& corners) {
  using namespace OpenMesh::Decimater;
  DecimaterT<ProxyMesh> decimater(half_edge.mesh);
  ProxyPriority::Handle priority;
  ModNormalFlippingT<ProxyMesh>::Handle flipping;
  ProxyAttributes::Handle attributes;
  ModHausdorffT<ProxyMesh>::Handle distance;
  decimater.add(priority);
  decimater.add(flipping);  // cheap refusals first
  decimater.add(distance);
  decimater.add(attributes);
  // A thousandth of the tolerance squared: an edge's length decides only where shape does not.
  const double diagonal = static_cast<double>(geometry.box.diagonal());
  decimater.module(priority).setEdgeWeight(
      std::max(1e-3 * settings.max_error_m * settings.max_error_m, 1e-12 * diagonal * diagonal));
  // Below a right angle, since a face without an area has no normal and passes at 90 degrees.
  decimater.module(flipping).set_max_normal_deviation(75);
  decimater.module(distance).set_tolerance(settings.max_error_m);
  std::vector<std::array<int, 3>> vertices;
  for (const int f : half_edge.face_of) {
    const Corners& v = patch.faces[static_cast<std::size_t>(f)];
    vertices.push_back({static_cast<int>(v[0]), static_cast<int>(v[1]), static_cast<int>(v[2])});
  }
  ProxyAttributes& carried = decimater.module(attributes);
  carried.setUp(geometry, settings, std::move(corners), std::move(vertices));
  if (decimater.initialize()) decimater.decimate();
  corners.clear();
  for (std::size_t f = 0; f < half_edge.face_of.size(); ++f)
    corners.push_back(carried.corners(static_cast<int>(f)));
}

}  // namespace

std::vector<std::optional<Corners>> decimatePatch(const Geometry& geometry, const Patch& patch,
                                                  std::span<const Corners> corners,
                                                  const DecimateSettings& settings) {
  HalfEdgePatch half_edge;
  fillMesh(geometry, patch, half_edge);
  std::vector<Corners> mesh_corners;
  for (const int f : half_edge.face_of)
    mesh_corners.push_back(corners[static_cast<std::size_t>(f)]);
  decimateMesh(half_edge, geometry, patch, settings, mesh_corners);
  std::vector<std::optional<Corners>> result(corners.begin(), corners.end());
  for (std::size_t f = 0; f < half_edge.face_of.size(); ++f) {
    const auto handle = ProxyMesh::FaceHandle(static_cast<int>(f));
    auto& place = result[static_cast<std::size_t>(half_edge.face_of[f])];
    if (half_edge.mesh.status(handle).deleted())
      place.reset();
    else
      place = mesh_corners[f];
  }
  return result;
}

}  // namespace probelab
