// SPDX-License-Identifier: Apache-2.0
#include "nearest.h"

#include <algorithm>

namespace probelab {
namespace {
double squaredDistance(const Vec3f& a, const Vec3f& b) {
  const Vec3d d = Vec3d(a) - Vec3d(b);
  return dot(d, d);
}
}  // namespace

NearestPoints::NearestPoints(std::span<const Vec3f> positions, std::vector<int> indices)
    : positions_(positions), order_(std::move(indices)), axis_(order_.size()) {
  build(0, order_.size());
}

void NearestPoints::build(std::size_t begin, std::size_t end) {
  if (end - begin < 2) return;
  Box3f box;
  for (std::size_t i = begin; i < end; ++i) box.extend(positions_[order_[i]]);
  const Vec3f extent = box.extent();
  const unsigned char axis = extent.x >= extent.y && extent.x >= extent.z ? 0
                             : extent.y >= extent.z                       ? 1
                                                                          : 2;
  const std::size_t middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](int a, int b) {
                     return std::pair(positions_[a][axis], a) < std::pair(positions_[b][axis], b);
                   });
  axis_[middle] = axis;
  build(begin, middle);
  build(middle + 1, end);
}

void NearestPoints::query(const Vec3f& point, std::size_t k,
                          std::vector<std::pair<double, int>>& result) const {
  result.clear();
  if (k > 0) search(0, order_.size(), point, k, result);
  std::sort_heap(result.begin(), result.end());
}

void NearestPoints::search(std::size_t begin, std::size_t end, const Vec3f& point, std::size_t k,
                           std::vector<std::pair<double, int>>& heap) const {
  if (begin >= end) return;
  const std::size_t middle = begin + (end - begin) / 2;
  const Vec3f& node = positions_[order_[middle]];
  const std::pair candidate(squaredDistance(point, node), order_[middle]);
  if (heap.size() < k || candidate < heap.front()) {
    if (heap.size() == k) std::pop_heap(heap.begin(), heap.end()), heap.pop_back();
    heap.push_back(candidate);
    std::push_heap(heap.begin(), heap.end());
  }
  const double side = double(point[axis_[middle]]) - double(node[axis_[middle]]);
  const bool left_first = side < 0;
  const std::size_t near_begin = left_first ? begin : middle + 1;
  const std::size_t near_end = left_first ? middle : end;
  search(near_begin, near_end, point, k, heap);
  // Equality too: a point just as far with a smaller index may lie beyond the plane.
  if (heap.size() < k || side * side <= heap.front().first) {
    if (left_first)
      search(middle + 1, end, point, k, heap);
    else
      search(begin, middle, point, k, heap);
  }
}

}  // namespace probelab
