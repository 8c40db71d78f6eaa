// SPDX-License-Identifier: GPL-3.0-or-later
// `grid_best`: where a lattice lies moves its error more than anything else, so the honest baseline
// tries places and shapes and takes what scores best on the train receivers.
#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "placement/lattices.h"
#include "placement/training.h"

namespace probelab {
namespace {

constexpr std::array<double, 3> kVerticals = {1, 0.6, 1.6};
constexpr std::size_t kOtherCounts = 12;

struct Candidate {
  LatticeBox box;
  Vec3i count;
  bool operator==(const Candidate&) const = default;
};

class Sweep {
 public:
  Sweep(const PlacementInput& input, const LayoutFinish& finish, std::size_t expected)
      : input_(input), finish_(finish), expected_(expected) {}

  void add(const Candidate& candidate) {
    if (std::ranges::find(tried_, candidate) != tried_.end()) return;
    tried_.push_back(candidate);
    ProbeLayout layout = usableLayout(latticeIn(input_, candidate.box, candidate.count), input_);
    if (finish_) layout = finish_(layout);
    const double score = input_.training.score(layout, input_.params);
    if (score < best_score_) best_score_ = score, best_ = candidate, layout_ = std::move(layout);
    if (input_.progress)
      input_.progress(
          std::min(1.0, static_cast<double>(tried_.size()) / static_cast<double>(expected_)));
  }
  const Candidate& best() const { return best_; }
  ProbeLayout take() { return std::move(layout_); }

 private:
  const PlacementInput& input_;
  const LayoutFinish& finish_;
  std::size_t expected_;
  std::vector<Candidate> tried_;
  double best_score_ = std::numeric_limits<double>::infinity();
  Candidate best_{};
  ProbeLayout layout_;
};

}  // namespace

ProbeLayout bestLattice(const PlacementInput& input, const LayoutFinish& finish) {
  const std::vector<LatticeBox> boxes = likelyBoxes(input);
  Sweep sweep(input, finish, boxes.size() * (kVerticals.size() + 1) + kOtherCounts);
  for (const LatticeBox& box : boxes)
    for (const double vertical : kVerticals)
      sweep.add({box, cubicCounts(outerBox(input, box).extent(), input.probes, vertical)});
  const LatticeBox best_box = sweep.best().box;
  for (const Vec3i& count :
       likelyCounts(outerBox(input, best_box).extent(), input.probes, kOtherCounts))
    sweep.add({best_box, count});
  const Vec3i best_count = sweep.best().count;
  for (const LatticeBox& box : boxes) sweep.add({box, best_count});
  return sweep.take();
}

const Strategy kGridBestStrategy = {
    "grid_best",
    "the best of 20 to 40 lattices (boxes, insets, shapes of the cell) on the train receivers",
    {},
    [](const PlacementInput& input) { return bestLattice(input); }};

}  // namespace probelab
