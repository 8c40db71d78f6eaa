// SPDX-License-Identifier: Apache-2.0
// The half-edge mesh of ray proxies and the two decimation modules that OpenMesh lacks.
#pragma once

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModBaseT.hh>
#include <OpenMesh/Tools/Decimater/ModHausdorffT.hh>
#include <OpenMesh/Tools/Decimater/ModNormalFlippingT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>
#include <algorithm>
#include <array>
#include <vector>

#include "base/vec.h"
#include "proxy_decimate.h"
#include "triangle_distance.h"

namespace probelab {

struct ProxyTraits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
};
using ProxyMesh = OpenMesh::TriMesh_ArrayKernelT<ProxyTraits>;
using ProxyCollapse = OpenMesh::Decimater::CollapseInfoT<ProxyMesh>;

inline Vec3d toVec(const OpenMesh::Vec3d& p) { return {p[0], p[1], p[2]}; }

// ModQuadric as the priority, made fit for planes: there the quadric is zero up to a rounding error
// of either sign, the decimater refuses negative priorities, and ties would build fans of hundreds
// of faces. Short edges go first instead.
class ProxyPriority : public OpenMesh::Decimater::ModQuadricT<ProxyMesh> {
 public:
  using Handle = OpenMesh::Decimater::ModHandleT<ProxyPriority>;
  explicit ProxyPriority(ProxyMesh& mesh) : ModQuadricT(mesh) {}
  // Square metres that one square metre of an edge's squared length counts for.
  void setEdgeWeight(double weight) { edge_weight_ = weight; }
  float collapse_priority(const ProxyCollapse& collapse) override {
    const float error = std::max(ModQuadricT::collapse_priority(collapse), 0.0f);
    return error + static_cast<float>(edge_weight_ * (collapse.p1 - collapse.p0).sqrnorm());
  }

 private:
  double edge_weight_ = 0;
};

// Keeps the new faces near the original surface: ModHausdorff asks whether what went is near what
// came, so a flap across a corner passes. Carries the attributes of corners through collapses and
// keeps them true: OpenMesh's own half-edge properties end up at other faces' corners. A vertex on
// a seam of attributes moves along the seam only; every vertex that went, with its attributes, is
// remembered at a face that reproduces them.
class ProxyAttributes : public OpenMesh::Decimater::ModBaseT<ProxyMesh> {
  using Base = OpenMesh::Decimater::ModBaseT<ProxyMesh>;

 public:
  using Handle = OpenMesh::Decimater::ModHandleT<ProxyAttributes>;
  using Mesh = ProxyMesh;
  explicit ProxyAttributes(ProxyMesh& mesh) : Base(mesh, true) {}
  const std::string& name() const override {
    static const std::string name = "ProxyAttributes";
    return name;
  }
  // `corners` [face of the mesh] slots in the order of the given face.
  void setUp(const Geometry& geometry, const DecimateSettings& settings,
             std::vector<Corners> corners, std::vector<std::array<int, 3>> vertices);
  const Corners& corners(int face) const { return corners_[static_cast<std::size_t>(face)]; }

  float collapse_priority(const ProxyCollapse& collapse) override;
  void preprocess_collapse(const ProxyCollapse& collapse) override;

 private:
  struct MovedFace {
    int face = 0;
    std::size_t slot = 0;   // of the corner that moves
    Corners corners;        // after the collapse
    TrianglePoints points;  // after the collapse
  };
  bool plan(const ProxyCollapse& collapse, std::vector<MovedFace>& moved,
            std::vector<uint32_t>& samples) const;
  int seamsAround(const ProxyCollapse& collapse) const;
  bool moveFace(const ProxyCollapse& collapse, int face, uint32_t corner, MovedFace& moved) const;
  uint32_t cornerAt(int face, int vertex) const;
  // Metres by which the face misses the vertex and its attributes; infinite when beyond the bounds.
  double miss(const MovedFace& moved, uint32_t vertex) const;
  bool staysNear(const ProxyCollapse& collapse, const std::vector<MovedFace>& moved);
  bool samplesHold(const std::vector<MovedFace>& moved, const std::vector<uint32_t>& samples) const;
  bool normalHolds(const MovedFace& moved, const Vec2d& weights, uint32_t vertex) const;
  double textureMiss(const MovedFace& moved, const Vec2d& weights, uint32_t vertex,
                     const std::vector<Vec2f>& uv) const;

  const Geometry* geometry_ = nullptr;
  DecimateSettings settings_;
  double slack_m_ = 0, min_cos_turn_ = 0;
  bool has_attributes_ = false;
  std::vector<Corners> corners_;                // [face][slot] the geometry's vertex
  std::vector<std::array<int, 3>> vertices_;    // [face][slot] the mesh's vertex
  std::vector<uint32_t> hints_;                 // [face] for TriangleDistance::within
  std::vector<std::vector<uint32_t>> samples_;  // [face] vertices that went
};

}  // namespace probelab
