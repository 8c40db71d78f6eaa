// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/nearest_probes.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace probelab {

NearestProbes::NearestProbes(std::span<const Vec3f> points) {
  nodes_.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    nodes_.push_back({points[i], static_cast<uint32_t>(i), 0});
  build(0, nodes_.size());
}

void NearestProbes::build(std::size_t begin, std::size_t end) {
  if (end - begin < 2) return;
  Box3f box;
  for (std::size_t i = begin; i < end; ++i) box.extend(nodes_[i].position);
  const Vec3f edge = box.extent();
  const std::size_t axis =
      edge.x >= edge.y ? (edge.x >= edge.z ? 0u : 2u) : (edge.y >= edge.z ? 1u : 2u);
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [&](std::size_t i) { return nodes_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end), [&](const Node& a, const Node& b) {
    return a.position[axis] != b.position[axis] ? a.position[axis] < b.position[axis]
                                                : a.index < b.index;
  });
  nodes_[middle].axis = static_cast<uint32_t>(axis);
  build(begin, middle);
  build(middle + 1, end);
}

void NearestProbes::search(std::size_t begin, std::size_t end, Search& s) const {
  if (begin >= end) return;
  const std::size_t middle = begin + (end - begin) / 2;
  const Node& node = nodes_[middle];
  const NearProbe here{length(node.position - s.p), node.index};
  if (here < s.limit) {
    s.found.push_back(here);
    std::push_heap(s.found.begin(), s.found.end());
    if (s.found.size() > s.count) {
      std::pop_heap(s.found.begin(), s.found.end());
      s.found.pop_back();
    }
    if (s.found.size() == s.count && s.found.front() < s.limit) s.limit = s.found.front();
  }
  const float aside = s.p[node.axis] - node.position[node.axis];
  const bool lower_first = aside <= 0;
  lower_first ? search(begin, middle, s) : search(middle + 1, end, s);
  if (std::abs(aside) > s.limit.distance_m) return;
  lower_first ? search(middle + 1, end, s) : search(begin, middle, s);
}

void NearestProbes::nearest(const Vec3f& p, std::size_t count,
                            std::vector<NearProbe>& found) const {
  found.clear();
  if (count == 0) return;
  constexpr NearProbe kAll{std::numeric_limits<float>::infinity(), 0};
  Search s{p, count, kAll, found};
  search(0, nodes_.size(), s);
  std::sort_heap(found.begin(), found.end());
}

void NearestProbes::within(const Vec3f& p, float radius_m, std::vector<NearProbe>& found) const {
  found.clear();
  Search s{p, nodes_.size() + 1, {radius_m, 0}, found};
  search(0, nodes_.size(), s);
  std::sort_heap(found.begin(), found.end());
}

}  // namespace probelab
