// SPDX-License-Identifier: GPL-3.0-or-later
// `grid_sparse`: a lattice so fine that N of its points lie in free space; the others store
// nothing.
#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "placement/lattices.h"
#include "placement/training.h"

namespace probelab {
namespace {

constexpr std::array<double, 3> kVerticals = {1, 0.6, 1.6};
constexpr std::size_t kAround = 8;
constexpr int kMostPoints = 1 << 22;   // of the underlying lattice
constexpr int kMostRefinement = 1024;  // of its points over N

// Lattices by their number of points; remembers the one with the most usable points within N.
class Search {
 public:
  Search(const PlacementInput& input, const LatticeBox& box, double vertical, double offset)
      : input_(input), box_(box), vertical_(vertical), offset_(offset) {}

  // Usable points of the lattice with up to `points` points.
  int tryPoints(int points) { return tryCount(cubicCounts(edges(), points, 1)); }
  int tryCount(const Vec3i& count) {
    if (count == last_) return last_usable_;
    const Lattice lattice = moved(latticeIn(input_, box_, count));
    const std::vector<uint8_t> keep = usablePoints(lattice, input_);
    const auto usable = static_cast<int>(std::ranges::count(keep, uint8_t{1}));
    if (usable <= input_.probes && usable > best_usable_) best_ = lattice, best_usable_ = usable;
    last_ = count;
    return last_usable_ = usable;
  }
  // Of the box, squeezed along y where the spacing is to be longer there.
  Vec3f edges() const {
    Vec3f result = outerBox(input_, box_).extent();
    result.y /= static_cast<float>(vertical_);
    return result;
  }
  int bestUsable() const { return best_usable_; }
  const Lattice& best() const { return best_; }

 private:
  // By the offset along every axis, and a point longer, so that it fills the box all the same.
  Lattice moved(Lattice lattice) const {
    if (offset_ == 0) return lattice;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (lattice.count[axis] == 1) continue;
      const double back = offset_ > 0 ? offset_ - 1 : offset_;
      lattice.first[axis] += lattice.spacing[axis] * static_cast<float>(back);
      ++lattice.count[axis];
    }
    return lattice;
  }

  const PlacementInput& input_;
  const LatticeBox& box_;
  double vertical_, offset_;
  Vec3i last_{0, 0, 0};
  int last_usable_ = 0;
  Lattice best_;
  int best_usable_ = -1;
};

}  // namespace

Lattice sparseLattice(const PlacementInput& input, const LatticeBox& box, double vertical,
                      double offset) {
  const int probes = input.probes;
  const int most = static_cast<int>(std::clamp<long long>(
      static_cast<long long>(probes) * kMostRefinement, probes, std::max(kMostPoints, probes)));
  Search search(input, box, vertical, offset);
  int few = probes, many = probes;
  while (search.tryPoints(many) <= probes && many < most) {
    few = many;
    many = static_cast<int>(std::min<long long>(2LL * many, most));
  }
  while (many - few > std::max(1, few / 200)) {
    const int middle = few + (many - few) / 2;
    (search.tryPoints(middle) <= probes ? few : many) = middle;
  }
  // Usable points do not grow evenly with the lattice: look around as well, at most 2 % below N.
  for (const double around : {1.0, 1.05, 1.1, 0.95})
    for (const Vec3i& count : likelyCounts(
             search.edges(), std::clamp(static_cast<int>(around * few), probes, most), kAround))
      if (search.bestUsable() < probes - probes / 50) search.tryCount(count);
  return search.best();
}

ProbeLayout bestSparseLattice(const PlacementInput& input, bool sweep, const LayoutFinish& finish,
                              double offset) {
  const auto layoutIn = [&](const LatticeBox& box, double vertical) {
    ProbeLayout layout = usableLayout(sparseLattice(input, box, vertical, offset), input);
    return finish ? finish(layout) : layout;
  };
  if (!sweep) return layoutIn({true, 0.05}, 1);
  const std::vector<LatticeBox> boxes = likelyBoxes(input);
  double best_score = std::numeric_limits<double>::infinity();
  ProbeLayout best;
  std::size_t done = 0;
  for (const LatticeBox& box : boxes)
    for (const double vertical : kVerticals) {
      ProbeLayout layout = layoutIn(box, vertical);
      const double score = input.training.score(layout, input.params);
      if (score < best_score) best_score = score, best = std::move(layout);
      if (input.progress)
        input.progress(static_cast<double>(++done) /
                       static_cast<double>(boxes.size() * kVerticals.size()));
    }
  return best;
}

const Strategy kGridSparseStrategy = {
    "grid_sparse",
    "a lattice refined until N of its points lie in free space",
    {{"sweep", "on", "on | off",
      "try boxes, insets and shapes of the cell and take the best on the train receivers"},
     {"offset", "0", "-0.5 .. 0.5", "shift of the lattice along every axis, x its spacing"}},
    [](const PlacementInput& input) {
      return bestSparseLattice(input, choiceOption(input, "sweep", {"on", "off"}) == 0, {},
                               numberOption(input, "offset", -0.5, 0.5));
    }};

}  // namespace probelab
