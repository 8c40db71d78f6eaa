// SPDX-License-Identifier: GPL-3.0-or-later
// The nearest of many probes: a k-d tree.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/vec.h"

namespace probelab {

struct NearProbe {
  float distance_m = 0;
  uint32_t index = 0;
  // By distance, then by index: so the order is unique.
  auto operator<=>(const NearProbe&) const = default;
};

class NearestProbes {
 public:
  explicit NearestProbes(std::span<const Vec3f> points);  // copied
  std::size_t size() const { return nodes_.size(); }

  // The `count` points nearest to p, nearest first; fewer when there are fewer.
  void nearest(const Vec3f& p, std::size_t count, std::vector<NearProbe>& found) const;
  // All points nearer than the radius, nearest first.
  void within(const Vec3f& p, float radius_m, std::vector<NearProbe>& found) const;

 private:
  struct Node {
    Vec3f position;
    uint32_t index, axis;
  };
  struct Search {
    Vec3f p;
    std::size_t count;              // at most that many
    NearProbe limit;                // only what comes before
    std::vector<NearProbe>& found;  // a heap, the last one on top
  };
  void build(std::size_t begin, std::size_t end);
  void search(std::size_t begin, std::size_t end, Search& search) const;

  std::vector<Node> nodes_;  // the middle of each range splits it
};

}  // namespace probelab
