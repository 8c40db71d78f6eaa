// SPDX-License-Identifier: Apache-2.0
#include "voxelize.h"

#include <algorithm>
#include <cmath>

namespace probelab {
namespace {

// Whether the axis separates the triangle from a box with half extents h around the origin.
bool separates(const Vec3d& axis, const std::array<Vec3d, 3>& t, const Vec3d& h) {
  const double a = dot(axis, t[0]), b = dot(axis, t[1]), c = dot(axis, t[2]);
  const double reach = h.x * std::abs(axis.x) + h.y * std::abs(axis.y) + h.z * std::abs(axis.z);
  return std::min({a, b, c}) > reach || std::max({a, b, c}) < -reach;
}

// A block of cells, halved along its longest side until it is a cell or the triangle misses it.
struct CellWalk {
  const std::array<Vec3d, 3>& triangle;
  Vec3d low, cell;
  const std::function<void(const Vec3i&)>& visit;

  void walk(const Vec3i& first, const Vec3i& last) const {  // last is included
    const Vec3d grow = cell * 1e-6;
    const Box3d box{low + cell * Vec3d(first) - grow, low + cell * (Vec3d(last) + Vec3d(1)) + grow};
    if (!overlaps(triangle, box)) return;
    const Vec3i size = last - first;
    const std::size_t axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
    if (size[axis] == 0) {
      visit(first);
      return;
    }
    Vec3i middle_low = last, middle_high = first;
    middle_low[axis] = first[axis] + size[axis] / 2;
    middle_high[axis] = middle_low[axis] + 1;
    walk(first, middle_low);
    walk(middle_high, last);
  }
};

}  // namespace

bool overlaps(const std::array<Vec3d, 3>& triangle, const Box3d& box) {
  const Vec3d center = box.center(), h = box.extent() * 0.5;
  const std::array<Vec3d, 3> t = {triangle[0] - center, triangle[1] - center, triangle[2] - center};
  const Vec3d axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const Vec3d& axis : axes)
    if (separates(axis, t, h)) return false;
  const Vec3d edges[3] = {t[1] - t[0], t[2] - t[1], t[0] - t[2]};
  if (separates(cross(edges[0], edges[1]), t, h)) return false;
  for (const Vec3d& axis : axes)
    for (const Vec3d& edge : edges)
      if (separates(cross(axis, edge), t, h)) return false;
  return true;
}

void visitCells(const std::array<Vec3d, 3>& triangle, const Box3d& bounds, const Vec3i& resolution,
                const std::function<void(const Vec3i&)>& visit) {
  const CellWalk walk{triangle, bounds.min, bounds.extent() / Vec3d(resolution), visit};
  Vec3i first, last;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double low = std::min({triangle[0][axis], triangle[1][axis], triangle[2][axis]});
    const double high = std::max({triangle[0][axis], triangle[1][axis], triangle[2][axis]});
    const double n = resolution[axis];
    const auto cellOf = [&](double x) {
      return std::floor((x - bounds.min[axis]) / walk.cell[axis]);
    };
    // One cell more on each side: the faces belong to both.
    const double a = cellOf(low) - 1, b = cellOf(high) + 1;
    if (a >= n || b < 0) return;
    first[axis] = static_cast<int>(std::clamp(a, 0.0, n - 1));
    last[axis] = static_cast<int>(std::clamp(b, 0.0, n - 1));
  }
  walk.walk(first, last);
}

}  // namespace probelab
