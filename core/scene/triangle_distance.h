// SPDX-License-Identifier: Apache-2.0
// Distance from a point to a set of triangles, exact in double. Used to measure ray proxies.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/vec.h"

namespace probelab {

using TrianglePoints = std::array<Vec3d, 3>;

// Weights of the second and third vertex of the triangle's point closest to `p` (Ericson,
// Real-Time Collision Detection, 2005, 5.1.5). Degenerate triangles give a point of theirs.
Vec2d closestOnTriangle(const TrianglePoints& triangle, const Vec3d& p);
inline Vec3d pointOf(const TrianglePoints& t, const Vec2d& weights) {
  return t[0] + (t[1] - t[0]) * weights.x + (t[2] - t[0]) * weights.y;
}

class TriangleDistance {
 public:
  explicit TriangleDistance(std::vector<TrianglePoints> triangles);
  // Metres; infinity without triangles.
  double operator()(const Vec3d& p) const {
    uint32_t found = 0;
    return std::sqrt(search(p, kFar, 0, found));
  }
  // Whether a triangle lies within `distance_m`. `hint` is tried first and becomes the one that was
  // found; 0 to begin with. It changes the time taken, never the answer.
  bool within(const Vec3d& p, double distance_m, uint32_t& hint) const;

 private:
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  struct Node {
    Box3d box;
    uint32_t first = 0, count = 0;  // of triangles_; count = 0: an inner node
    uint32_t right = 0;             // the left child is the next node
  };
  // Smallest squared distance, or any at most `enough`; `best` when nothing is closer than that.
  double search(const Vec3d& p, double best, double enough, uint32_t& found) const;
  void build(std::span<TrianglePoints> triangles, uint32_t first);
  double leafDistance(const Node& node, const Vec3d& p, double best, uint32_t& found) const;

  std::vector<TrianglePoints> triangles_;
  std::vector<Node> nodes_;
};

}  // namespace probelab
