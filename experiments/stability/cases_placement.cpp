// SPDX-License-Identifier: GPL-3.0-or-later
// Scattered probes where geometry degenerates, ties, impossible lengths, tuning at the end of a
// range.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/rng.h"
#include "cases.h"
#include "ddgi/snapshot.h"
#include "placement/corner_weights.h"
#include "placement/nearest_probes.h"
#include "placement/report.h"
#include "placement/training.h"
#include "tuning/solve.h"

namespace probelab {
namespace {

using std::numbers::pi;

// A room with everything that the interpolants ask for.
struct Place {
  BuiltScene built{furnace(0.5f, 1)};
  Reachability reachability = findReachable(built.scene, built.embree);
  Params params = loadParams("probelab");
  Training training{built.scene, built.embree, reachability,
                    TrainingSettings{16, 1, Split::train, 7}};
  PlacementInput input{built.scene, built.embree, reachability, params, training, 8, 1, {}};
  FreeSpace space{input};
};

CornerWeights weightsOf(const std::string& interpolant, const Lattice& corners,
                        const std::vector<Vec3f>& positions, const FreeSpace& space) {
  if (interpolant == "natural") return naturalWeights(corners, positions, space, {});
#ifdef PROBELAB_WITH_CGAL
  if (interpolant == "tetrahedra") return tetrahedraWeights(corners, positions, space, {});
#endif
  return nearestWeights(corners, positions, space,
                        {.sharpness = interpolant == "maxent" ? 1.0 : 0});
}

std::vector<CaseVariant> interpolants() {
  return {{"", "knn"},
          {"", "maxent"},
          {"", "natural"},
#ifdef PROBELAB_WITH_CGAL
          {"", "tetrahedra"}
#endif
  };
}

// Every probe holds the same light: so must every answer, and no voxel may be empty. Largest
// relative error over random points and points on voxel faces.
double constantError(const ProbeLayout& layout, const Params& params) {
  FieldSnapshot field = layoutSnapshot(layout, initialStates(layout), params);
  const auto texels = [&](int interior) {
    const int side = interior + 2 * field.lattice.border;
    return layout.positions.size() * static_cast<std::size_t>(side * side);
  };
  field.irradiance.assign(texels(field.lattice.irradiance_texels), Vec3f(0.5f));
  field.moments.assign(texels(field.lattice.moment_texels), Vec2f(0.4f, 0.2f));
  std::vector<QueryPoint> points = randomPoints({Vec3f(0.01f), Vec3f(1.99f)}, 500, 11);
  for (std::size_t i = 0; i < 200; ++i)
    points[i].position = layout.influence.corners.position(
        static_cast<int>(i % static_cast<std::size_t>(layout.influence.corners.pointCount())));
  double worst = 0;
  for (const QueryPoint& p : points) {
    if (!layout.bounds.contains(p.position)) continue;
    const double e = querySnapshot<double>(field, field.params, p).irradiance.y;
    worst = larger(worst, std::abs(e / (pi / 2) - 1));
  }
  return worst;
}

ProbeLayout scattered(const Place& place, const std::string& interpolant,
                      const std::vector<Vec3f>& positions) {
  const Lattice corners = influenceCorners(place.built.scene.bounds, 0.6);
  ProbeLayout layout =
      scatteredLayout(Interpolant::knn, positions, place.built.scene.bounds, corners,
                      weightsOf(interpolant, corners, positions, place.space));
  layout.strategy = interpolant;
  return layout;
}

std::vector<Vec3f> randomPlaces(int count, uint64_t seed) {
  std::vector<Vec3f> positions;
  for (const QueryPoint& p : randomPoints({Vec3f(0.1f), Vec3f(1.9f)}, count, seed))
    positions.push_back(p.position);
  return positions;
}

Measurement partition(Workbench&, const CaseVariant& variant) {
  const Place place;
  return within(constantError(scattered(place, variant.format, randomPlaces(30, 12)), place.params),
                1e-6, "error");
}

// What the weights are, not only that they add up: those of the k nearest are their kernel's, and
// the others' meet in the point itself, up to a 510th of every probe's way, for the rounding of bytes
// and the interpolants' own stiffness and sampling. Largest distance of the weighted mean of the
// probes' places from the point, over that.
double meetingError(const ProbeLayout& layout) {
  double worst = 0;
  // Corners around them lie well within the probes' hull.
  for (const QueryPoint& at : randomPoints({Vec3f(0.7f), Vec3f(1.3f)}, 500, 17)) {
    Vec3d mean;
    double sum = 0, allowed = 1e-5;
    for (const CornerWeight& w : weightsAt(layout, at.position)) {
      const Vec3d away = Vec3d(layout.positions[w.probe]) - Vec3d(at.position);
      mean += away * static_cast<double>(w.weight);
      sum += static_cast<double>(w.weight);
      allowed += length(away) / 510;
    }
    worst = larger(worst, length(mean) / sum / allowed);
  }
  return worst;
}

// 216 probes, each somewhere in its cell of a lattice.
std::vector<Vec3f> jitteredPlaces() {
  std::vector<Vec3f> positions;
  Rng rng(18, RngStream::stability);
  for (int i = 0; i < 216; ++i) {
    const Vec3f cell(static_cast<float>(i % 6), static_cast<float>(i / 6 % 6),
                     static_cast<float>(i / 36));
    const Vec3f jitter(rng.nextFloat(), rng.nextFloat(), rng.nextFloat());
    positions.push_back(Vec3f(0.1f) + (cell + jitter) * 0.3f);
  }
  return positions;
}

// Largest difference of a corner's normalised weights from (1 - d / r)^2 of the eight nearest, r the
// ninth's distance.
double kernelError(const CornerWeights& weights, const Lattice& corners,
                   const std::vector<Vec3f>& positions) {
  double worst = 0;
  for (int corner = 0; corner < corners.pointCount(); ++corner) {
    std::vector<std::pair<double, uint32_t>> near;
    for (uint32_t i = 0; i < positions.size(); ++i)
      near.emplace_back(length(Vec3d(positions[i]) - Vec3d(corners.position(corner))), i);
    std::sort(near.begin(), near.end());
    std::vector<double> wanted(positions.size(), 0.0), found = wanted;
    double wanted_sum = 0, found_sum = 0;
    for (std::size_t k = 0; k < 8; ++k) {
      const double left = 1 - near[k].first / near[8].first;
      wanted_sum += wanted[near[k].second] = left * left;
    }
    for (const CornerWeight& w : weights[static_cast<std::size_t>(corner)])
      found_sum += found[w.probe] = static_cast<double>(w.weight);
    for (std::size_t i = 0; i < positions.size(); ++i)
      worst = larger(worst, std::abs(found[i] / found_sum - wanted[i] / wanted_sum));
  }
  return worst;
}

Measurement meanings(Workbench&, const CaseVariant& variant) {
  const Place place;
  const std::vector<Vec3f> positions = jitteredPlaces();
  if (variant.format == "knn") {
    const Lattice inner = makeLattice({Vec3f(0.3f), Vec3f(1.7f)}, Vec3i(5, 5, 5));
    return within(kernelError(weightsOf("knn", inner, positions, place.space), inner, positions),
                  1e-5, "weights off by");
  }
  return within(meetingError(scattered(place, variant.format, positions)), 1,
                "of what is allowed:");
}

// Coplanar, collinear, three, one, and probes that all but coincide.
Measurement degenerate(Workbench&, const CaseVariant& variant) {
  const Place place;
  std::vector<Vec3f> plane = randomPlaces(12, 13), line = plane;
  for (Vec3f& p : plane) p.y = 1;
  for (std::size_t i = 0; i < line.size(); ++i)
    line[i] = Vec3f(0.2f) + Vec3f(0.13f) * static_cast<float>(i);
  std::vector<Vec3f> twins = randomPlaces(8, 14);
  for (int i = 0; i < 4; ++i) twins.push_back(twins[static_cast<std::size_t>(i)] + Vec3f(1e-6f));
  std::vector<Vec3f> lattice;
  for (int i = 0; i < 27; ++i)
    lattice.push_back(Vec3f(0.4f) + Vec3f(static_cast<float>(i % 3), static_cast<float>(i / 3 % 3),
                                          static_cast<float>(i / 9)) *
                                        0.6f);
  const std::vector<std::vector<Vec3f>> sets{plane,      line,  {line[0], line[5], plane[3]},
                                             {Vec3f(1)}, twins, lattice};
  double worst = 0;
  for (const auto& positions : sets)
    worst = larger(worst, constantError(scattered(place, variant.format, positions), place.params));
  return within(worst, 1e-6, fmt::format("{} layouts, error", sets.size()));
}

// The corners of a cube seen from its middle: all eight are as near.
Measurement nearestTies(Workbench&, const CaseVariant&) {
  const Place place;
  std::vector<Vec3f> cube;
  for (int i = 0; i < 8; ++i)
    cube.emplace_back(i & 1 ? 1.5f : 0.5f, i & 2 ? 1.5f : 0.5f, i & 4 ? 1.5f : 0.5f);
  std::vector<NearProbe> found;
  NearestProbes(cube).nearest(Vec3f(1), 4, found);
  bool ordered = found.size() == 4;
  for (uint32_t i = 0; i < found.size(); ++i) ordered = ordered && found[i].index == i;
  const std::vector<CornerWeight> tied =
      nearestFrom(NearestProbes(cube), cube, place.space, {Vec3f(1)}, {.k = 4});
  double least = 1, most = 0;
  for (const CornerWeight& w : tied) {
    const double weight = static_cast<double>(w.weight);
    least = smaller(least, weight), most = larger(most, weight);
  }
  const double error = constantError(scattered(place, "knn", cube), place.params);
  return both(checked(ordered && !tied.empty() && most > 0 && least == most,
                      fmt::format("{} of 8 by index, {} with weights of {:.2g} to {:.2g}",
                                  found.size(), tied.size(), least, most)),
              within(error, 1e-6, "error"));
}

// Lattice points half-way between active probes: the smaller index, whatever the order of search.
Measurement latticeTies(Workbench&, const CaseVariant&) {
  const ProbeLayout layout =
      fullLattice({Vec3f(0), Vec3f(4, 1, 1)}, Vec3i(5, 2, 2), {Vec3f(-1), Vec3f(5)});
  ProbeStates states = initialStates(layout);
  for (std::size_t i = 0; i < states.active.size(); ++i) states.active[i] = i % 5 % 4 == 0 ? 1 : 0;
  const std::vector<int> nearest = nearestIndex(layout, states);
  bool smaller = true;
  for (std::size_t i = 0; i < nearest.size(); ++i)
    if (i % 5 == 2) smaller = smaller && nearest[i] == static_cast<int>(i) - 2;
  return checked(smaller && nearest == nearestIndex(layout, states),
                 smaller ? "the smaller index of two" : "not the smaller index");
}

Measurement impossibleLengths(Workbench&, const CaseVariant&) {
  const Place place;
  const ProbeLayout good = scattered(place, "knn", randomPlaces(10, 15));
  validateLayout(good, place.params);
  Measurement result = checked(true, "");
  for (const float bad : {0.0f, -1.0f, std::numeric_limits<float>::infinity(),
                          std::numeric_limits<float>::quiet_NaN()})
    for (int field = 0; field < 4; ++field) {
      ProbeLayout layout = good;
      (field == 0   ? layout.lengths[3].bias
       : field == 1 ? layout.lengths[3].support
       : field == 2 ? layout.bias_length_m
                    : layout.support_radius_m) = bad;
      const Measurement one = refused([&] { validateLayout(layout, place.params); }, {"knn"});
      if (one.verdict != Verdict::holds) return one;
      result = one;
    }
  result.text = "16 refused; " + result.text;
  return result;
}

// Truth made with a parameter at an end of its range: the solver goes there and no farther.
Measurement tuningEnds(Workbench&, const CaseVariant& variant) {
  const bool low = variant.format == "low";
  const Params base = loadParams("rtxgi");
  const std::vector<std::string> names{"normal_bias", "visibility_floor"};
  const std::vector<TunedKey> keys = tunedKeys(names, base).inner;
  const std::vector<double> wanted(2, low ? 0.0 : 1.0);
  Params truth = base;
  setCoordinates(keys, wanted, truth);
  const ProbeLayout layout = fullLattice({Vec3f(0.3f), Vec3f(3.7f, 1.7f, 1.7f)}, Vec3i(4, 3, 3),
                                         {Vec3f(0), Vec3f(4, 2, 2)});
  FrozenState state;
  state.scene = "ends", state.state = "default";
  state.field = layoutSnapshot(layout, initialStates(layout), base);
  Rng rng(7, RngStream::stability);
  const auto texels = [&](int interior) {
    const int side = interior + 2 * state.field.lattice.border;
    return layout.positions.size() * static_cast<std::size_t>(side * side);
  };
  for (std::size_t i = 0; i < texels(state.field.lattice.irradiance_texels); ++i)
    state.field.irradiance.emplace_back(0.5f + rng.nextFloat());
  for (std::size_t i = 0; i < texels(state.field.lattice.moment_texels); ++i) {
    const float mean = 0.2f + 0.2f * rng.nextFloat();
    state.field.moments.emplace_back(mean, mean * mean * 1.02f);
  }
  for (const QueryPoint& p : randomPoints(layout.bounds, 300, 16))
    state.points.push_back({p, 0, 1.0 / 300, 0, false});
  const std::vector<double> answers = queryPoints(state, truth);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    state.points[i].truth = answers[i];
    state.power += answers[i] * answers[i] / 300, state.mean += answers[i] / 300;
  }
  const SolveResult result =
      solveTuning({{&state, 1}, keys, base, {}}, {.starts = 4, .candidates = 16});
  double off = 0;
  bool inside = true;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    off = larger(off, std::abs(result.x[i] - wanted[i]));
    inside = inside && result.x[i] >= 0 && result.x[i] <= 1;
  }
  return both(within(off, 0.02, "coordinates off by"),
              checked(inside, inside ? "inside" : "outside"));
}

}  // namespace

std::vector<StabilityCase> placementCases() {
  return {
      {"placement.partition", "30 scattered probes that hold the same light",
       "no place without an answer: the same everywhere within 1e-6", "", interpolants(),
       partition},
      {"placement.weights", "216 probes, each somewhere in its cell of a lattice",
       "knn: (1 - d / r)^2 of the eight nearest within 1e-5; others: the weighted mean of the "
       "probes' places is the point, within half a 255th a weight",
       "", interpolants(), meanings},
      {"placement.degenerate", "probes in a plane, a line, three, one, twins, a lattice",
       "no place without an answer: the same everywhere within 1e-6", "", interpolants(),
       degenerate},
      {"placement.nearest_ties",
       "eight probes as near as each other, four asked for",
       "the first four by index, equal weights above 0",
       "",
       {},
       nearestTies},
      {"placement.lattice_ties",
       "lattice points half-way between active probes",
       "the smaller index",
       "",
       {},
       latticeTies},
      {"placement.impossible_lengths",
       "bias lengths and support radii of 0, infinity, NaN",
       "error",
       "",
       {},
       impossibleLengths},
      {"placement.tuning_ends",
       "truth at the ends of two parameters' ranges",
       "the solver ends within 0.02 of the range, never outside",
       "",
       {{"", "low"}, {"", "high"}},
       tuningEnds},
  };
}

}  // namespace probelab
