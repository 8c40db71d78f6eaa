// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/weight_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

#include "base/interrupt.h"
#include "base/parallel.h"

namespace probelab {
namespace {

constexpr std::size_t kParts = 16;  // of the points; each sums a gradient of its own, in order
constexpr double kMostCost = 10;    // of a point at the start, times the mean of the others
// Adam (Kingma and Ba 2015).
constexpr double kRate = 0.08, kFirst = 0.9, kSecond = 0.99, kTiny = 1e-12;

// One corner's share in the weight of a probe at a point.
struct Term {
  uint32_t unknown;
  float share;
};
// A probe at a point: its terms, what the query makes of it, its values.
struct Link {
  uint32_t first_term, term_count;
  float gain;
  uint32_t values;
};
// Everything that does not change while fitting.
struct Problem {
  std::size_t states = 0;
  std::vector<uint32_t> link_begin;  // [point + 1]
  std::vector<Link> links;
  std::vector<Term> terms;
  std::vector<float> values;   // [link][state]
  std::vector<float> weights;  // [point][state]
  const std::vector<float>* truth = nullptr;
  bool squared = false;
};

// The objective's weights of every point and state.
std::vector<float> costWeights(const Training::Data& data, const JudgedPoints& judged,
                               const Objective& objective) {
  const std::size_t states = data.stateCount();
  std::vector<float> weights(judged.points.size() * states, 0.0f);
  for (std::size_t r = 0; r < judged.points.size(); ++r)
    for (std::size_t l = 0; l < states; ++l)
      weights[r * states + l] = static_cast<float>(
          judged.points[r].area *
          errorWeight(data, objective, l, static_cast<double>(judged.truth[r * states + l])));
  return weights;
}

Problem makeProblem(const Training::Data& data, const JudgedPoints& judged,
                    const ProbeLayout& layout, const CornerWeights& corner_weights,
                    const VoxelPieces& pieces, const std::vector<uint32_t>& first_unknown,
                    const Params& params) {
  Problem problem;
  problem.states = data.stateCount();
  problem.truth = &judged.truth;
  const QueryModes modes = queryModes(params);
  const auto query = convertQueryParams<float>(queryParams(params));
  problem.squared = modes.average != PL_AVERAGE_LINEAR;
  const auto [plan, baked] = bakeLayout(*data.patches, layout, params, data.settings.seed);
  problem.link_begin.push_back(0);
  for (const Receiver& r : judged.points) {
    const Vec3f biased = r.position + (r.normal * query.normal_bias - r.view * query.view_bias) *
                                          layout.bias_length_m;
    const Lattice& corners = layout.influence.corners;
    const VoxelPlace place =
        voxelAt(corners, pieces, lookupPlace(pieces.planes.empty() ? 0 : 1, layout.bias_length_m,
                                             r.position, r.normal, biased));
    std::vector<std::pair<uint32_t, Term>> found;  // probe and term
    for (std::size_t i = 0; i < 8; ++i) {
      const std::size_t at = pieces.lists.empty()
                                 ? voxelCorner(corners, place.voxel, static_cast<int>(i))
                                 : pieces.lists[place.piece][i];
      const std::vector<CornerWeight>& list = corner_weights[at];
      for (std::size_t e = 0; e < list.size() && place.share[i] > 0; ++e)
        found.push_back(
            {list[e].probe, {first_unknown[at] + static_cast<uint32_t>(e), place.share[i]}});
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    for (std::size_t i = 0; i < found.size();) {
      const uint32_t p = found[i].first;
      Link link{static_cast<uint32_t>(problem.terms.size()), 0, 0,
                static_cast<uint32_t>(problem.values.size())};
      for (; i < found.size() && found[i].first == p; ++i) problem.terms.push_back(found[i].second);
      link.term_count = static_cast<uint32_t>(problem.terms.size()) - link.first_term;
      link.gain =
          queryGain(query, modes, plan.moment_texels, r, baked[p], probeLengths(layout, p).bias);
      problem.values.resize(problem.values.size() + problem.states);
      queryValues(modes, plan.irradiance_texels, problem.states,
                  readDirection(query, modes, plan.moment_texels, r, baked[p]), baked[p],
                  &problem.values[link.values]);
      problem.links.push_back(link);
    }
    problem.link_begin.push_back(static_cast<uint32_t>(problem.links.size()));
  }
  return problem;
}

// Cost of one point; adds its gradient by the logarithms of the unknowns, unless that is empty.
double pointCost(const Problem& problem, std::size_t r, const std::vector<double>& unknowns,
                 std::span<double> gradient) {
  const std::size_t states = problem.states;
  std::array<double, kMostStates> mean{}, slope{};
  std::array<double, 256> weight;
  const uint32_t begin = problem.link_begin[r];
  const uint32_t count = std::min<uint32_t>(problem.link_begin[r + 1] - begin, 256);
  double total = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const Link& link = problem.links[begin + i];
    double w = 0;
    for (uint32_t t = 0; t < link.term_count; ++t) {
      const Term& term = problem.terms[link.first_term + t];
      w += static_cast<double>(term.share) * unknowns[term.unknown];
    }
    weight[i] = w * static_cast<double>(link.gain);
    total += weight[i];
    for (std::size_t l = 0; l < states; ++l)
      mean[l] += weight[i] * static_cast<double>(problem.values[link.values + l]);
  }
  if (!(total > 1e-12)) return 0;
  double cost = 0;
  for (std::size_t l = 0; l < states; ++l) {
    mean[l] /= total;
    const double estimate = problem.squared ? mean[l] * mean[l] : mean[l];
    const double d = estimate - static_cast<double>((*problem.truth)[r * states + l]);
    const double k = static_cast<double>(problem.weights[r * states + l]);
    cost += k * d * d;
    slope[l] = 2 * k * d * (problem.squared ? 2 * mean[l] : 1) / total;
  }
  for (uint32_t i = 0; i < count && !gradient.empty(); ++i) {
    const Link& link = problem.links[begin + i];
    double by_weight = 0;
    for (std::size_t l = 0; l < states; ++l)
      by_weight += slope[l] * (static_cast<double>(problem.values[link.values + l]) - mean[l]);
    by_weight *= static_cast<double>(link.gain);
    for (uint32_t t = 0; t < link.term_count; ++t) {
      const Term& term = problem.terms[link.first_term + t];
      gradient[term.unknown] +=
          by_weight * static_cast<double>(term.share) * unknowns[term.unknown];
    }
  }
  return cost;
}

// A place that looks into a lamp near by costs as much as thousands of others, and no weights can
// mend it: they would follow it, and be worse around it. So no point weighs more than kMostCost
// times the mean of the others at the start, the costliest hundredth aside.
void capPoints(Problem& problem, const std::vector<double>& start) {
  const std::size_t points = problem.link_begin.size() - 1;
  std::vector<double> costs(points);
  parallelFor(points, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) costs[r] = pointCost(problem, r, start, {});
  });
  std::vector<double> sorted = costs;
  std::sort(sorted.begin(), sorted.end());
  sorted.resize(points - points / 100);
  const double most = kMostCost * std::accumulate(sorted.begin(), sorted.end(), 0.0) /
                      static_cast<double>(sorted.size());
  if (!(most > 0)) return;
  for (std::size_t r = 0; r < points; ++r)
    if (costs[r] > most)
      for (std::size_t l = 0; l < problem.states; ++l)
        problem.weights[r * problem.states + l] *= static_cast<float>(most / costs[r]);
}

double costAndGradient(const Problem& problem, const std::vector<double>& unknowns,
                       std::vector<double>& gradient) {
  const std::size_t points = problem.link_begin.size() - 1;
  std::vector<std::vector<double>> parts(kParts);
  std::vector<double> costs(kParts, 0.0);
  parallelFor(kParts, 1, [&](std::size_t first, std::size_t last) {
    for (std::size_t part = first; part < last; ++part) {
      parts[part].assign(unknowns.size(), 0.0);
      for (std::size_t r = part * points / kParts; r < (part + 1) * points / kParts; ++r)
        costs[part] += pointCost(problem, r, unknowns, parts[part]);
    }
  });
  gradient.assign(unknowns.size(), 0.0);
  double cost = 0;
  for (std::size_t part = 0; part < kParts; ++part) {
    cost += costs[part];
    for (std::size_t i = 0; i < unknowns.size(); ++i) gradient[i] += parts[part][i];
  }
  return cost;
}

}  // namespace

CornerWeights cornerWeights(const InfluenceGrid& grid) {
  CornerWeights weights(static_cast<std::size_t>(grid.corners.pointCount()));
  const Vec3i voxels = grid.voxels(), corners = grid.corners.count;
  for (int v = 0; v < voxels.x * voxels.y * voxels.z; ++v) {
    const int x = v % voxels.x, y = v / voxels.x % voxels.y, z = v / (voxels.x * voxels.y);
    const auto voxel = static_cast<std::size_t>(v);
    for (uint32_t e = grid.voxel_begin[voxel]; e < grid.voxel_begin[voxel + 1]; ++e)
      for (int i = 0; i < 8; ++i) {
        const InfluenceEntry& entry = grid.entries[e];
        const uint8_t weight = entry.weights[static_cast<std::size_t>(i)];
        if (weight == 0) continue;
        const int corner =
            ((z + (i >> 2)) * corners.y + y + ((i >> 1) & 1)) * corners.x + x + (i & 1);
        std::vector<CornerWeight>& list = weights[static_cast<std::size_t>(corner)];
        if (std::ranges::none_of(list, [&](const auto& w) { return w.probe == entry.probe; }))
          list.push_back({entry.probe, byteWeight(weight)});
      }
  }
  return weights;
}

CornerWeights fitWeights(const Training::Data& data, const JudgedPoints& judged,
                         const ProbeLayout& layout, CornerWeights weights,
                         const VoxelPieces& pieces, const Params& params,
                         const Objective& objective, const FitSettings& settings) {
  std::vector<uint32_t> first_unknown;
  std::vector<double> start;
  for (std::vector<CornerWeight>& list : weights) {
    first_unknown.push_back(static_cast<uint32_t>(start.size()));
    double sum = 0;
    for (const CornerWeight& w : list) sum += static_cast<double>(w.weight);
    for (const CornerWeight& w : list)
      start.push_back(sum > 0 ? std::max(static_cast<double>(w.weight) / sum, 1e-4) : 1.0);
  }
  Problem problem = makeProblem(data, judged, layout, weights, pieces, first_unknown, params);
  problem.weights = costWeights(data, judged, objective);
  capPoints(problem, start);
  const std::size_t n = start.size();
  std::vector<double> unknowns = start, logs(n, 0.0), gradient, first(n, 0.0), second(n, 0.0);
  double pull = 0;
  for (int i = 1; i <= settings.iterations; ++i) {
    throwIfInterrupted();
    const double cost = costAndGradient(problem, unknowns, gradient);
    if (i == 1) pull = settings.stiffness * cost / static_cast<double>(n);
    const double rate = kRate * (1 - static_cast<double>(i) / (settings.iterations + 1));
    for (std::size_t u = 0; u < n; ++u) {
      const double g = gradient[u] + 2 * pull * logs[u];
      first[u] = kFirst * first[u] + (1 - kFirst) * g;
      second[u] = kSecond * second[u] + (1 - kSecond) * g * g;
      const double mean = first[u] / (1 - std::pow(kFirst, i));
      const double square = second[u] / (1 - std::pow(kSecond, i));
      logs[u] -= rate * mean / (std::sqrt(square) + kTiny);
      unknowns[u] = start[u] * std::exp(logs[u]);
    }
  }
  for (std::size_t c = 0; c < weights.size(); ++c)
    for (std::size_t e = 0; e < weights[c].size(); ++e)
      weights[c][e].weight = static_cast<float>(unknowns[first_unknown[c] + e]);
  return weights;
}

}  // namespace probelab
