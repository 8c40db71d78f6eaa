// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/local_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "base/interrupt.h"
#include "base/parallel.h"
#include "trace/sampling.h"

namespace probelab {
namespace {

constexpr int kBatch = 128;        // proposals at once
constexpr int kRemovalRounds = 8;  // after which costs of removal are found anew
constexpr int kRivals = 6;         // probes that compete for being swapped out
constexpr float kFirstStep = 0.7f, kLastStep = 0.08f;  // of the spacing, longest move
constexpr float kSwapReach = 0.7f;   // of the spacing, from the receiver that calls a probe
constexpr double kLeastGain = 1e-7;  // of the cost
constexpr double kNever = 1e300;

struct Proposal {
  int removed = -1;
  Vec3f position;
};

Vec3f randomDirection(Rng& rng) {
  const float a = rng.nextFloat(), b = rng.nextFloat();
  return sampleSphere({a, b});
}

class Search {
 public:
  Search(SubsetModel& model, const JudgedPoints& judged, const Training::Data& data,
         const BakePlan& plan, const FreeSpace& space, const SceneDistance& distance,
         const SearchSettings& settings, uint64_t seed)
      : model_(model),
        judged_(judged),
        data_(data),
        plan_(plan),
        space_(space),
        distance_(distance),
        settings_(settings),
        rng_(seed, RngStream::placement, 20) {}

  uint64_t run(const std::function<void(double)>& progress) {
    const auto rounds =
        static_cast<int>(std::ceil(settings_.proposals_a_probe * settings_.probes / kBatch));
    uint64_t tried = 0;
    for (int round = 0; round < rounds; ++round) {
      throwIfInterrupted();
      const float done = static_cast<float>(round) / static_cast<float>(rounds);
      if (progress) progress(static_cast<double>(done));
      longest_move_ = settings_.spacing_m * (kFirstStep * (1 - done) + kLastStep * done);
      if (round % kRemovalRounds == 0) findRemovalCosts();
      findCumulativeCosts();
      const std::vector<Proposal> proposals = makeProposals();
      tried += proposals.size();
      if (proposals.empty()) break;
      takeBest(proposals);
    }
    return tried;
  }

 private:
  void findRemovalCosts() {
    const std::vector<int>& probes = model_.probes();
    if (probes.empty()) return;
    removal_.assign(static_cast<std::size_t>(probes.back()) + 1, kNever);
    parallelFor(probes.size(), 4, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        removal_[static_cast<std::size_t>(probes[i])] = model_.tryChange({probes[i], nullptr});
    });
  }

  void findCumulativeCosts() {
    cumulative_.resize(model_.receiverCount());
    double sum = 0;
    for (std::size_t r = 0; r < cumulative_.size(); ++r) cumulative_[r] = sum += model_.costAt(r);
    total_ = sum;
  }

  double removalCost(int probe) const {
    const auto p = static_cast<std::size_t>(probe);
    return p < removal_.size() ? removal_[p] : kNever;
  }

  std::vector<Proposal> makeProposals() {
    std::vector<Proposal> proposals;
    for (int tries = 0; tries < 20 * kBatch && static_cast<int>(proposals.size()) < kBatch;
         ++tries) {
      const bool missing = static_cast<int>(model_.probes().size()) < settings_.probes;
      const bool swap = static_cast<double>(rng_.nextFloat()) < settings_.swap_share;
      const std::optional<Proposal> proposal =
          missing || swap ? proposeSwap(missing) : proposeMove();
      if (proposal) proposals.push_back(*proposal);
    }
    return proposals;
  }

  // A step that the clearance allows cannot cross a wall; a longer one is looked along.
  std::optional<Proposal> proposeMove() {
    const int probe = model_.probes()[rng_.nextBelow(model_.probes().size())];
    const Vec3f direction = randomDirection(rng_);
    const float step = longest_move_ * rng_.nextFloat();
    const Vec3f from = model_.probe(probe).position;
    const Vec3f to = from + direction * step;
    if (!(static_cast<double>(step) < distance_.clearance(from)) && !space_.lineFree(from, to))
      return std::nullopt;
    if (!isFit(to)) return std::nullopt;
    return Proposal{probe, to};
  }

  // A probe near a receiver that is answered badly, for one that is missed little.
  std::optional<Proposal> proposeSwap(bool missing) {
    const double u = rng_.nextDouble() * total_;
    const auto found = std::lower_bound(cumulative_.begin(), cumulative_.end(), u);
    const auto r = static_cast<std::size_t>(
        std::min(found - cumulative_.begin(), static_cast<std::ptrdiff_t>(cumulative_.size()) - 1));
    const Receiver& receiver = judged_.points[r];
    const bool surface = receiver.kind == ReceiverKind::surface;
    const float s = kSwapReach * settings_.spacing_m;
    const float away = s * (0.05f + 0.95f * rng_.nextFloat());
    const Vec3f aside = randomDirection(rng_) * (0.6f * s * rng_.nextFloat());
    const Vec3f from = receiver.position + receiver.normal * (1e-4f * data_.embree.extent());
    const Vec3f to = receiver.position + (surface ? receiver.normal * away : Vec3f()) + aside;
    Proposal proposal{-1, to};
    if (!missing) {
      double least = kNever;
      for (int i = 0; i < kRivals; ++i) {
        const int rival = model_.probes()[rng_.nextBelow(model_.probes().size())];
        if (removalCost(rival) < least) least = removalCost(rival), proposal.removed = rival;
      }
      if (proposal.removed < 0) return std::nullopt;
    }
    if (!space_.lineFree(from, to) || !isFit(to)) return std::nullopt;
    return proposal;
  }

  bool isFit(const Vec3f& p) const {
    const std::optional<ClosestPoint> wall = distance_.closest(p);
    if (wall && wall->distance_m < static_cast<double>(settings_.wall_gap_m) &&
        !isInTheMiddle(p, *wall))
      return false;
    return space_.usable(p);
  }

  // Where there is less room than two gaps, the middle half of it will do.
  bool isInTheMiddle(const Vec3f& p, const ClosestPoint& wall) const {
    const auto near = static_cast<float>(wall.distance_m);
    if (!(near > 0)) return false;
    const Vec3f away = (p - Vec3f(wall.point)) / near;
    return data_.embree.occluded(Ray{p, 0, away, 3 * near});
  }

  void takeBest(const std::vector<Proposal>& proposals) {
    std::vector<Vec3f> positions;
    for (const Proposal& p : proposals) positions.push_back(p.position);
    const std::vector<BakedProbe> baked = bakeProbes(*data_.patches, plan_, positions);
    std::vector<double> gain(proposals.size());
    parallelFor(proposals.size(), 2, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        gain[i] = model_.screenChange({proposals[i].removed, &baked[i]});
    });
    std::vector<std::size_t> order(proposals.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return gain[a] < gain[b]; });
    std::vector<uint8_t> taken(model_.receiverCount(), 0);
    std::vector<int> changed;
    for (const std::size_t i : order) {
      if (!(gain[i] < -kLeastGain * total_)) break;
      const Proposal& p = proposals[i];
      if (std::ranges::find(changed, p.removed) != changed.end() && p.removed >= 0) continue;
      if (p.removed < 0 && static_cast<int>(model_.probes().size()) >= settings_.probes) continue;
      const std::vector<uint32_t> touched = model_.touched({p.removed, &baked[i]});
      if (std::ranges::any_of(touched, [&](uint32_t r) { return taken[r] != 0; })) continue;
      for (const uint32_t r : touched) taken[r] = 1;
      if (p.removed >= 0) model_.remove(p.removed);
      const int added = model_.add(baked[i]);
      changed.push_back(added);
      if (static_cast<std::size_t>(added) < removal_.size())
        removal_[static_cast<std::size_t>(added)] = kNever;
    }
  }

  SubsetModel& model_;
  const JudgedPoints& judged_;
  const Training::Data& data_;
  const BakePlan& plan_;
  const FreeSpace& space_;
  const SceneDistance& distance_;
  const SearchSettings& settings_;
  Rng rng_;
  float longest_move_ = 0;
  double total_ = 0;
  std::vector<double> removal_;     // [probe], cost of doing without it
  std::vector<double> cumulative_;  // [receiver]
};

}  // namespace

uint64_t searchPositions(SubsetModel& model, const Training::Data& data, const BakePlan& plan,
                         const FreeSpace& space, const SceneDistance& distance,
                         const SearchSettings& settings, uint64_t seed,
                         const std::function<void(double)>& progress) {
  return Search(model, model.judged(), data, plan, space, distance, settings, seed).run(progress);
}

}  // namespace probelab
