// SPDX-License-Identifier: Apache-2.0
// Edges are counted by a table of our own on welded positions: glTF splits vertices at normals and
// texture coordinates, and a half-edge mesh would refuse what has to be reported.
#include "scene/mesh_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <unordered_map>

namespace probelab {
namespace {

constexpr double kWeldShare = 1e-6;  // of the box's diagonal

// Union-find with the smallest index as the representative.
class Groups {
 public:
  explicit Groups(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
  uint32_t find(uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(uint32_t a, uint32_t b) {
    a = find(a), b = find(b);
    if (a != b) parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<uint32_t> parent_;
};

struct PositionHash {
  std::size_t operator()(const Vec3f& p) const {
    std::size_t h = 0;
    for (int c = 0; c < 3; ++c) h = h * 0x9E3779B97F4A7C15ull + std::hash<float>()(p[c]);
    return h ^ h >> 29;
  }
};

// The cell of a grid with cells as large as the welding distance; 21 bits an axis are enough for
// 1e6 cells.
uint64_t cellKey(const Vec3<int64_t>& cell) {
  constexpr uint64_t mask = (1u << 21) - 1;
  return (cell.x & mask) | (cell.y & mask) << 21 | (cell.z & mask) << 42;
}

// For each vertex the smallest index among those within `distance` of it, transitively.
std::vector<uint32_t> weld(const std::vector<Vec3f>& positions, const Vec3f& min, double distance) {
  Groups groups(positions.size());
  std::unordered_map<Vec3f, uint32_t, PositionHash> exact;
  std::unordered_map<uint64_t, std::vector<uint32_t>> cells;
  for (uint32_t i = 0; i < positions.size(); ++i) {
    const auto [it, added] = exact.try_emplace(positions[i] + Vec3f(0.0f), i);
    if (!added) {
      groups.join(it->second, i);
      continue;
    }
    if (!(distance > 0)) continue;
    const Vec3d p(positions[i]);
    const Vec3d scaled = (p - Vec3d(min)) / distance;
    const Vec3<int64_t> cell(static_cast<int64_t>(std::floor(scaled.x)),
                             static_cast<int64_t>(std::floor(scaled.y)),
                             static_cast<int64_t>(std::floor(scaled.z)));
    for (int k = 0; k < 27; ++k) {
      const auto found =
          cells.find(cellKey({cell.x + k % 3 - 1, cell.y + k / 3 % 3 - 1, cell.z + k / 9 - 1}));
      if (found == cells.end()) continue;
      for (const uint32_t other : found->second)
        if (length(Vec3d(positions[other]) - p) < distance) groups.join(other, i);
    }
    cells[cellKey(cell)].push_back(i);
  }
  std::vector<uint32_t> welded(positions.size());
  for (uint32_t i = 0; i < welded.size(); ++i) welded[i] = groups.find(i);
  return welded;
}

using Corners = std::array<uint32_t, 3>;

struct EdgeUse {
  uint32_t forward = 0, backward = 0;  // from the smaller index to the larger, and back
};

MeshEdges countEdges(std::string name, std::span<const Corners> triangles) {
  MeshEdges result;
  result.name = std::move(name);
  result.triangles = static_cast<uint32_t>(triangles.size());
  std::unordered_map<uint64_t, EdgeUse> edges;
  edges.reserve(triangles.size() * 3 / 2);
  for (const Corners& t : triangles) {
    // A triangle that welding has closed up separates nothing: its neighbours meet along it.
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    for (int e = 0; e < 3; ++e) {
      const uint32_t a = t[e], b = t[(e + 1) % 3];
      EdgeUse& use = edges[uint64_t{std::min(a, b)} << 32 | std::max(a, b)];
      ++(a < b ? use.forward : use.backward);
    }
  }
  for (const auto& [key, use] : edges) {
    const uint32_t count = use.forward + use.backward;
    result.boundary_edges += count == 1;
    result.nonmanifold_edges += count > 2;
    result.inconsistent_edges += count == 2 && use.forward != 1;
  }
  return result;
}

uint32_t countDuplicates(std::vector<Corners> triangles) {
  for (Corners& t : triangles) std::sort(t.begin(), t.end());
  std::sort(triangles.begin(), triangles.end());
  uint32_t count = 0;
  for (std::size_t i = 1; i < triangles.size(); ++i) count += triangles[i] == triangles[i - 1];
  return count;
}

// Consecutive primitives of one node and mesh ("node / mesh / primitive"): a primitive is what has
// one material, so it is open wherever the next one begins.
std::vector<MeshRange> wholeMeshes(const std::vector<MeshRange>& primitives) {
  std::vector<MeshRange> meshes;
  for (const MeshRange& primitive : primitives) {
    const std::string name = primitive.name.substr(0, primitive.name.rfind(" / "));
    const bool continues =
        !meshes.empty() && meshes.back().name == name &&
        meshes.back().first_triangle + meshes.back().triangle_count == primitive.first_triangle;
    if (continues)
      meshes.back().triangle_count += primitive.triangle_count;
    else
      meshes.push_back({name, primitive.first_triangle, primitive.triangle_count});
  }
  return meshes;
}

}  // namespace

MeshReport reportMesh(const Scene& scene) {
  MeshReport report;
  if (!scene.geometry) return report;
  const Geometry& g = *scene.geometry;
  report.degenerate_triangles = g.dropped_degenerate;
  if (g.triangles.empty()) return report;
  const std::vector<uint32_t> welded = weld(
      g.positions, g.box.min, kWeldShare * Box3d{Vec3d(g.box.min), Vec3d(g.box.max)}.diagonal());
  std::vector<bool> used(welded.size());
  std::vector<Corners> triangles;
  triangles.reserve(g.triangles.size());
  for (const Triangle& t : g.triangles) {
    triangles.push_back({welded[t.vertex[0]], welded[t.vertex[1]], welded[t.vertex[2]]});
    for (const uint32_t v : triangles.back()) used[v] = true;
  }
  report.welded_vertices = static_cast<uint32_t>(std::count(used.begin(), used.end(), true));
  report.all = countEdges("scene", triangles);
  for (const MeshRange& mesh : wholeMeshes(g.meshes))
    report.meshes.push_back(countEdges(
        mesh.name, std::span(triangles).subspan(mesh.first_triangle, mesh.triangle_count)));
  report.duplicate_triangles = countDuplicates(std::move(triangles));
  return report;
}

}  // namespace probelab
