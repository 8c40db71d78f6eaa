// SPDX-License-Identifier: GPL-3.0-or-later
// `optimized`: starts from the best lattice and moves, adds and swaps probes against the truth at
// train receivers and the pool's candidates, under the scene's train states and generated ones.
// Each state counts by its error under the start, so that no light is sacrificed for another.
// Lights that the search did not see choose the start, and check what came of it.
#include "placement/optimized.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/rng.h"
#include "placement/distance.h"
#include "placement/lattices.h"
#include "placement/local_search.h"
#include "placement/pool.h"
#include "placement/scattered.h"
#include "placement/training.h"
#include "placement/weight_fit.h"

namespace probelab {
namespace {

constexpr int kNeighbours = 12;           // that the search looks at
constexpr float kSupportSpacings = 2.2f;  // typical support radius over the spacing
constexpr float kReachSpacings = 3.0f;    // beyond, a new probe counts only where there is none
constexpr int64_t kMostPool = 4'000'000;

struct OptimizedOptions {
  bool own_only = false, check = true, sparse_start = false;
  int generated = 0;         // lighting states
  double wall_gap = 0;       // between moved probes and surfaces, mean spacings
  int pool = 0;              // candidates a probe
  int pool_least = 0;
  double pool_share = 0;
  double relative = 0, coverage = 0, covered = 0;
  float sharpness = 0;
  SearchSettings search;
  FitSettings fit;
};

// A probe beside a wall sees mostly what one lamp does to that wall: good where the lamp is known,
// bad for a whole room where it is another.
double wallGap(const PlacementInput& input, bool own_only) {
  if (input.options.at("wall_gap") == "auto") return own_only ? 0.02 : 0.1;
  return numberOption(input, "wall_gap", 0, 0.4, "auto");
}

// All of them, those that are used at the very end too: a search takes minutes.
OptimizedOptions readOptimized(const PlacementInput& input) {
  checkScatteredOptions(input);
  OptimizedOptions o;
  o.own_only = choiceOption(input, "lights", {"all", "own"}) == 1;
  o.check = choiceOption(input, "check", {"on", "off"}) == 0;
  o.sparse_start = choiceOption(input, "start", {"best", "sparse"}) == 1;
  o.generated = integerOption(input, "generated", 0, static_cast<int>(kMostStates));
  o.wall_gap = wallGap(input, o.own_only);
  o.pool = integerOption(input, "pool", 0, 1000);
  o.pool_least = integerOption(input, "pool_least", 0, 1000000);
  o.pool_share = numberOption(input, "pool_share", 0, 1);
  o.relative = numberOption(input, "relative", 0, 1);
  o.coverage = numberOption(input, "coverage", 0, 1e6);
  o.covered = numberOption(input, "covered", 0.1, 10);
  o.sharpness = static_cast<float>(numberOption(input, "sharpness", 0.01, 100));
  o.search.proposals_a_probe = numberOption(input, "proposals", 0, 1e6);
  o.search.swap_share = numberOption(input, "swaps", 0, 1);
  o.fit.iterations = integerOption(input, "fit", 0, 10000);
  o.fit.stiffness = numberOption(input, "stiffness", 0, 1e6);
  return o;
}

// States count by 1 / error^2 of the start, so that the sum falls as their geometric mean does;
// `coverage` is in units of what the start's errors cost.
Objective makeObjective(const Training::Data& data, std::span<const float> estimates,
                        double relative, double coverage, float covered_m) {
  const std::vector<double> errors = squaredErrors(data, estimates);
  Objective objective{errors, relative, 0, covered_m};
  double sum = 0;
  for (double& w : objective.state_weights) sum += w = w > 0 ? 1 / std::max(w, 1e-6) : 0;
  for (std::size_t l = 0; l < errors.size(); ++l) {
    double& w = objective.state_weights[l];
    w = sum > 0 ? w / sum : 0;
    objective.coverage += coverage * w * errors[l];
  }
  return objective;
}

// The input with a part of its progress, so that the whole runs from 0 to 1 once.
PlacementInput partOf(const PlacementInput& input, double from, double to) {
  PlacementInput part = input;
  if (input.progress)
    part.progress = [&input, from, to](double done) { input.progress(from + done * (to - from)); };
  return part;
}

// The best lattice there is under all lights or the scene's own, sparse or not, relocated or not; or
// a sparse one that nobody has scored. Its evaluations are those of both lattices' searches, whether
// they ran now or before.
ProbeLayout startLayout(const PlacementInput& input, bool sparse, bool own_only) {
  if (sparse) return bestSparseLattice(input, false);
  const SceneDistance distance(*input.scene.geometry);
  std::vector<ProbeLayout> candidates = {
      otherLayout(kGridSparseStrategy.name, partOf(input, 0, 0.15)),
      otherLayout(kGridBestStrategy.name, partOf(input, 0.15, 0.3))};
  const uint64_t evaluations = candidates[0].evaluations + candidates[1].evaluations;
  for (const std::size_t i : {0u, 1u})
    candidates.push_back(relocatedLattice(input, distance, candidates[i]));
  std::size_t best = 0;
  double best_score = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const double score = input.training.score(candidates[i], input.params, own_only);
    if (score < best_score) best_score = score, best = i;
  }
  candidates[best].evaluations = evaluations + candidates.size();
  candidates[best].options = {};  // the other strategy's
  return std::move(candidates[best]);
}

// What the search learns from: receivers and generated lights that nobody else has.
TrainingSettings searchSettings(const PlacementInput& input, const OptimizedOptions& options) {
  TrainingSettings settings = input.training.settings();
  settings.lights = options.own_only ? 0 : options.generated;
  settings.seed = hashCounters(input.seed, RngStream::placement, 40);
  return settings;
}

// Throws InputError where there is nothing to learn from.
void checkLit(const PlacementInput& input, const Training::Data& data) {
  if (std::ranges::any_of(data.power, [](double power) { return power > 0; })) return;
  throwInput("{}: optimized: no lighting state to train on lights a train receiver; add a light or a "
             "train state, or let it generate some (lights=all, generated=60)",
             input.scene.path);
}

ProbeLayout searchLayout(const PlacementInput& input, Training::Data& data,
                         const ProbeLayout& start, const OptimizedOptions& options) {
  const FreeSpace space(input);
  const SceneDistance distance(*input.scene.geometry);
  const auto spacing = static_cast<float>(space.spacing(input.probes));
  SearchSettings search = options.search;
  search.probes = input.probes;
  search.spacing_m = spacing;
  search.wall_gap_m = static_cast<float>(options.wall_gap) * spacing;
  const SubsetSettings settings = {
      .neighbours = kNeighbours,
      .sharpness = options.sharpness,
      .bias_length_m = spacing,
      .largest_reach_m = kReachSpacings * spacing};
  const BakePlan plan = makeBakePlan(
      input.params, kSearchRays,
      static_cast<float>(input.params.distance_clamp) * kSupportSpacings * spacing, input.seed);
  JudgedPoints judged = trainPoints(data);
  const int64_t pool = int64_t{options.pool} * input.probes;
  if (pool > 0)
    addPool(judged, data,
            {.points = static_cast<int>(std::clamp<int64_t>(pool, options.pool_least, kMostPool)),
             .share = options.pool_share,
             .spacing_m = spacing},
            input.seed);
  const Objective objective =
      makeObjective(data, estimateLayout(data, start, input.params), options.relative,
                    options.coverage, static_cast<float>(options.covered) * spacing);
  SubsetModel model(data, judged, input.params, plan, settings, objective);
  for (const BakedProbe& probe : bakeProbes(*data.patches, plan, start.positions)) model.add(probe);
  data.evaluations += searchPositions(model, data, plan, space, distance, search, input.seed,
                                      partOf(input, 0.3, 1).progress);
  const ScatteredWeights w = scatteredWeights(space, model.positions());
  ProbeLayout layout = scatteredLayout(w.interpolant, model.positions(), input.scene.bounds,
                                       w.corners, w.weights, w.pieces);
  if (options.fit.iterations == 0) return layout;
  // Without walls corners in solids have taken their neighbours' weights.
  const CornerWeights fitted =
      fitWeights(data, judged, layout, w.pieces.any() ? w.weights : cornerWeights(layout.influence),
                 w.pieces, input.params, objective, options.fit);
  return scatteredLayout(Interpolant::fitted, layout.positions, input.scene.bounds, w.corners,
                         fitted, w.pieces);
}

ProbeLayout placeOptimized(const PlacementInput& input) {
  const OptimizedOptions options = readOptimized(input);
  Training training(input.scene, input.embree, input.reachability,
                    searchSettings(input, options));
  checkLit(input, training.data());
  const ProbeLayout start = startLayout(input, options.sparse_start, options.own_only);
  const uint64_t before = input.training.evaluations();
  ProbeLayout layout = searchLayout(input, training.data(), start, options);
  if (options.check && input.training.score(start, input.params, options.own_only) <
                           input.training.score(layout, input.params, options.own_only))
    layout = start;
  layout.evaluations = start.evaluations + training.evaluations() + input.training.evaluations() -
                       before;
  return layout;
}

}  // namespace

const Strategy kOptimizedStrategy = {
    "optimized", "probes where they lower the error most at train receivers, under many lights",
    scatteredOptions({
        {"start", "best", "best | sparse",
         "the lattice to start from: the best of all, or unscored"},
        {"lights", "all", "all | own",
         "all: also under generated lights; own: for the scene's train states alone"},
        {"generated", "60", "0 .. 128",
         "lighting states made for the search, beside the scene's own; in all 128 at most"},
        {"proposals", "60", "0 .. 1e6", "moves and swaps tried for each probe"},
        {"swaps", "0.35", "0 .. 1", "share of swaps among them"},
        {"wall_gap", "auto", "auto | 0 .. 0.4",
         "kept between moved probes and surfaces, x mean spacing; auto: 0.1, lights=own 0.02"},
        {"pool", "40", "0 .. 1000",
         "candidates, x probes, that the chosen ones should make superfluous"},
        {"pool_least", "16000", "0 .. 1000000", "as many at least, however few the probes"},
        {"pool_share", "0.7", "0 .. 1", "their share of the cost; train receivers have the rest"},
        {"fit", "150", "0 .. 10000", "iterations of the fit of weights; 0: as interpolant says"},
        {"stiffness", "0.5", "0 .. 1e6", "pull of the fitted weights towards the interpolant's"},
        {"relative", "0.3", "0 .. 1", "share of relative error in the cost, for dark places"},
        {"check", "on", "on | off",
         "keep the start where other lights of its kind say that it is better"},
        {"coverage", "0", "0 .. 1e6",
         "cost of gaps between probes, for light that may fall anywhere"},
        {"covered", "0.9", "0.1 .. 10",
         "no gap: the 4th nearest visible probe is within this, x mean spacing"},
    }),
    placeOptimized};

}  // namespace probelab
