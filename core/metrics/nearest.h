// SPDX-License-Identifier: Apache-2.0
// Nearest neighbours among a set of points: a k-d tree without storage of its own but a
// permutation. Equal distances are ordered by index, so the answer is unique.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "base/vec.h"

namespace probelab {

class NearestPoints {
 public:
  // The tree of positions[i] for i in `indices`; `positions` must outlive it.
  NearestPoints(std::span<const Vec3f> positions, std::vector<int> indices);

  // The (squared distance, index) of the k nearest, nearest first; fewer where the set is smaller.
  // `result` is scratch space and output.
  void query(const Vec3f& point, std::size_t k, std::vector<std::pair<double, int>>& result) const;

 private:
  void build(std::size_t begin, std::size_t end);
  void search(std::size_t begin, std::size_t end, const Vec3f& point, std::size_t k,
              std::vector<std::pair<double, int>>& heap) const;

  std::span<const Vec3f> positions_;
  std::vector<int> order_;           // the middle of a range is its node
  std::vector<unsigned char> axis_;  // of the node at that place
};

}  // namespace probelab
