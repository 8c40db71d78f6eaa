// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/subset_model.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "placement/maxent.h"
#include "shared/query.h"

namespace probelab {
namespace {

constexpr uint32_t kScreened = 6;     // a screening looks at every sixth point
constexpr int kListed = 16;           // nearest visible probes that a receiver knows, at most
constexpr std::size_t kCovering = 4;  // visible probes that a place should have near
constexpr float kLift = 1e-4f;        // of the scene's extent, off the surface for visibility rays
constexpr std::size_t kGrain = 64;    // points that a thread takes at once
constexpr float kGap = 1e-3f;         // share of a visibility ray left out at its end

// The moments of one probe as the shared query reads them.
struct MomentField {
  const BakedProbe& probe;
  float unit;
  Vec2f fetchMoments(int /*probe*/, int texel) const {
    const Vec2f& m = probe.moments[static_cast<std::size_t>(texel)];
    return {m.x * unit, m.y * unit * unit};
  }
  float fetchAhead(int /*probe*/, int texel) const {
    return probe.moments[static_cast<std::size_t>(texel)].x;
  }
};

bool isSqrtAverage(const QueryModes& modes) { return modes.average != PL_AVERAGE_LINEAR; }

}  // namespace

JudgedPoints trainPoints(const Training::Data& data) { return {data.receivers, data.truth}; }

SubsetModel::SubsetModel(const Training::Data& data, const JudgedPoints& judged,
                         const Params& params, const BakePlan& plan, const SubsetSettings& settings,
                         const Objective& objective)
    : data_(data),
      judged_(judged),
      query_(convertQueryParams<float>(queryParams(params))),
      modes_(queryModes(params)),
      plan_(plan),
      settings_(settings),
      states_(data.stateCount()),
      coverage_(objective.coverage),
      covered_m_(objective.covered_m) {
  PROBELAB_CHECK(states_ <= kMostStates);
  const std::size_t count = judged.points.size();
  weights_.assign(count * states_, 0.0f);
  for (std::size_t r = 0; r < count; ++r)
    for (std::size_t l = 0; l < states_; ++l)
      weights_[r * states_ + l] = static_cast<float>(
          judged.points[r].area *
          errorWeight(data, objective, l, static_cast<double>(judged.truth[r * states_ + l])));
  const float lift = kLift * data.embree.extent();
  for (const Receiver& r : judged.points) lifted_.push_back(r.position + r.normal * lift);
  lists_.resize(count);
  values_.assign(count * kListed * states_, 0.0f);
  costs_.assign(count, 0.0);

  box_ = {};
  for (const Receiver& r : judged.points) box_.extend(r.position);
  for (std::size_t axis = 0; axis < 3; ++axis)  // never flat
    box_.max[axis] += 1e-3f * std::max(maxComponent(box_.extent()), data.embree.extent());
  const Vec3f edge = box_.extent();
  const float size = std::cbrt(edge.x * edge.y * edge.z / 2048.0f);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cells_[axis] = std::clamp(static_cast<int>(edge[axis] / size), 1, 64);
    cell_size_[axis] = edge[axis] / static_cast<float>(cells_[axis]);
  }
  cell_receivers_.resize(static_cast<std::size_t>(cells_.x * cells_.y * cells_.z));
  cell_reach_.assign(cell_receivers_.size(), std::numeric_limits<float>::infinity());
  for (std::size_t r = 0; r < count; ++r) {
    int cell = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const auto a = static_cast<std::size_t>(axis);
      const int at = static_cast<int>((judged.points[r].position[a] - box_.min[a]) / cell_size_[a]);
      cell = cell * cells_[a] + std::clamp(at, 0, cells_[a] - 1);
    }
    cell_receivers_[static_cast<std::size_t>(cell)].push_back(static_cast<uint32_t>(r));
  }
  for (std::size_t r = 0; r < count; ++r) costs_[r] = costWith(r, {});
}

double errorWeight(const Training::Data& data, const Objective& objective, std::size_t state,
                   double e) {
  if (!(data.power[state] > 0)) return 0;
  const double mean = data.mean[state];
  return objective.state_weights[state] * ((1 - objective.relative) / data.power[state] +
                                           objective.relative / ((e + 0.1 * mean) * mean));
}

float queryGain(const QueryParams<float>& query, const QueryModes& modes, int moment_texels,
                const Receiver& r, const BakedProbe& probe, float bias_length_m) {
  const Vec3f biased =
      r.position + (r.normal * query.normal_bias - r.view * query.view_bias) * bias_length_m;
  const Vec3f& seen_from = modes.facing == PL_FACING_WRAP_BIASED ? biased : r.position;
  const Vec3f to = probe.position - seen_from;
  const float length_sq = dot(to, to);
  const float cosine = length_sq > 0 ? dot(to, r.normal) / std::sqrt(length_sq) : 1.0f;
  float visibility = 1;
  if (modes.visibility != 0) {
    const Vec3f offset = biased - probe.position;
    const float distance = length(offset);
    // In units of the distance itself, which keeps squares of any scene's lengths in range.
    const float unit = distance > 0 ? 1 / distance : 1.0f;
    const OctTaps<float> taps = octTaps(distance > 0 ? offset : Vec3f(0, 0, 1), moment_texels, 0);
    const Vec2f moments = readMoments<MomentField, float>({probe, unit}, 0, taps);
    visibility = visibilityWeight(query, moments, distance * unit);
  }
  return probeWeight(query, modes, 1.0f, cosine, visibility);
}

void queryValues(const QueryModes& modes, int texels, std::size_t states, const Vec3f& direction,
                 const BakedProbe& probe, float* values) {
  const OctTaps<float> t = octTaps(direction, texels, 0);
  const float x = t.fraction_x, y = t.fraction_y;
  const float* a = &probe.mean_radiance[static_cast<std::size_t>(t.texel_00) * states];
  const float* b = &probe.mean_radiance[static_cast<std::size_t>(t.texel_10) * states];
  const float* c = &probe.mean_radiance[static_cast<std::size_t>(t.texel_01) * states];
  const float* d = &probe.mean_radiance[static_cast<std::size_t>(t.texel_11) * states];
  for (std::size_t l = 0; l < states; ++l)
    values[l] = (a[l] * (1 - x) + b[l] * x) * (1 - y) + (c[l] * (1 - x) + d[l] * x) * y;
  if (isSqrtAverage(modes))
    for (std::size_t l = 0; l < states; ++l) values[l] = std::sqrt(values[l]);
}

Vec3f readDirection(const QueryParams<float>& query, const QueryModes& modes, int moment_texels,
                    const Receiver& r, const BakedProbe& probe) {
  if (modes.parallax == 0) return r.normal;
  LatticeShape metres{};
  metres.support_radius = 1;
  const float ahead = readAhead<MomentField, float>({probe, 1}, metres, 0,
                                                    octTaps(r.normal, moment_texels, 0));
  return parallaxDirection(query, r.normal, r.position - probe.position, ahead);
}

SubsetModel::Pair SubsetModel::pairOf(std::size_t receiver, const BakedProbe& probe,
                                      float* values) const {
  Pair pair;
  const Vec3f to = probe.position - lifted_[receiver];
  pair.offset = to;
  pair.distance = length(to);
  pair.visible =
      !(pair.distance > 0) || !data_.embree.occluded(Ray{lifted_[receiver], 0, to / pair.distance,
                                                         pair.distance * (1 - kGap)});
  if (!pair.visible) return pair;
  pair.gain = queryGain(query_, modes_, plan_.moment_texels, judged_.points[receiver], probe,
                        settings_.bias_length_m);
  queryValues(modes_, plan_.irradiance_texels, states_,
              readDirection(query_, modes_, plan_.moment_texels, judged_.points[receiver], probe),
              probe, values);
  return pair;
}

// Distance below which a new probe would change the receiver's answer.
float SubsetModel::reachOf(std::size_t receiver) const {
  const List& list = lists_[receiver];
  const auto k = static_cast<std::size_t>(settings_.neighbours);
  if (list.entries.empty()) return std::numeric_limits<float>::infinity();
  const float most = std::max(settings_.largest_reach_m, list.entries.front().distance);
  return list.entries.size() > k ? std::min(list.entries[k].distance, most) : most;
}

// Mean radiance under every state after a change.
float SubsetModel::estimateWith(std::size_t receiver, const Change& change,
                                std::span<float> estimate) const {
  std::array<float, kMostStates> added_values;
  Pair added;
  if (change.added != nullptr) added = pairOf(receiver, *change.added, added_values.data());
  // The k + 1 nearest after the change.
  struct Item {
    Vec3f offset;
    float distance, gain;
    const float* values;
  };
  std::array<Item, kListed + 1> items;
  const auto k = static_cast<std::size_t>(settings_.neighbours);
  std::size_t count = 0;
  bool pending = added.visible;
  const List& list = lists_[receiver];
  const float* rows = &values_[receiver * kListed * states_];
  for (const Entry& entry : list.entries) {
    if (entry.probe == change.removed) continue;
    if (pending && added.distance < entry.distance) {
      items[count++] = {added.offset, added.distance, added.gain, added_values.data()};
      pending = false;
    }
    if (count > k) break;
    items[count++] = {entry.offset, entry.distance, entry.gain,
                      rows + static_cast<std::size_t>(entry.row) * states_};
    if (count > k) break;
  }
  if (pending && count <= k)
    items[count++] = {added.offset, added.distance, added.gain, added_values.data()};
  std::fill(estimate.begin(), estimate.end(), 0.0f);
  if (count == 0) return settings_.largest_reach_m;
  const std::size_t used = std::min(count, k);
  const float support =
      count > k ? items[k].distance : kOpenSupport * items[count - 1].distance + 1e-20f;
  std::array<Vec3f, kListed + 1> offsets;
  std::array<float, kListed + 1> priors, shares;
  for (std::size_t i = 0; i < used; ++i) {
    offsets[i] = items[i].offset / support;
    priors[i] = maxentPrior(items[i].distance / support, settings_.sharpness);
  }
  if (!(priors[0] > 0)) priors[0] = 1;  // all at one distance
  maxentShares({offsets.data(), used}, {priors.data(), used}, {shares.data(), used});
  float total = 0;
  for (std::size_t i = 0; i < used; ++i) {
    const float w = shares[i] * items[i].gain;
    total += w;
    for (std::size_t l = 0; l < states_; ++l) estimate[l] += w * items[i].values[l];
  }
  if (!(total > 1e-12f)) {  // the nearest answers
    std::copy_n(items[0].values, states_, estimate.begin());
    total = 1;
  }
  const bool squared = isSqrtAverage(modes_);
  for (float& e : estimate) {
    e /= total;
    if (squared) e *= e;
  }
  return count < kCovering ? settings_.largest_reach_m : items[kCovering - 1].distance;
}

double SubsetModel::costWith(std::size_t receiver, const Change& change) const {
  std::array<float, kMostStates> buffer;
  const std::span<float> estimate(buffer.data(), states_);
  const float gap_m = estimateWith(receiver, change, estimate);
  const float* truth = &judged_.truth[receiver * states_];
  const float* weight = &weights_[receiver * states_];
  float cost = 0;
  for (std::size_t l = 0; l < states_; ++l) {
    const float d = estimate[l] - truth[l];
    cost += weight[l] * d * d;
  }
  const double gap = std::max(0.0, static_cast<double>(gap_m / covered_m_) - 1);
  return static_cast<double>(cost) + judged_.points[receiver].area * coverage_ * gap * gap;
}

template <class Visit>
void SubsetModel::forTouched(const Change& change, const Visit& visit) const {
  const auto k = static_cast<std::size_t>(settings_.neighbours);
  const auto counts = [&](uint32_t r) {  // the removed probe was among the first k + 1
    const std::vector<Entry>& entries = lists_[r].entries;
    for (std::size_t i = 0; i < std::min(entries.size(), k + 1); ++i)
      if (entries[i].probe == change.removed) return true;
    return false;
  };
  if (change.removed >= 0)
    for (const uint32_t r : users_[static_cast<std::size_t>(change.removed)])
      if (counts(r)) visit(r);
  if (change.added == nullptr) return;
  const Vec3f& p = change.added->position;
  for (std::size_t cell = 0; cell < cell_receivers_.size(); ++cell) {
    if (cell_receivers_[cell].empty()) continue;
    const auto c = static_cast<int>(cell);
    const Vec3f low =
        box_.min +
        Vec3f(Vec3i(c % cells_.x, c / cells_.x % cells_.y, c / (cells_.x * cells_.y))) * cell_size_;
    const Vec3f nearest = componentMax(low, componentMin(low + cell_size_, p));
    const Vec3f d = nearest - p;
    if (!(dot(d, d) < cell_reach_[cell] * cell_reach_[cell])) continue;
    for (const uint32_t r : cell_receivers_[cell]) {
      const Vec3f to = p - lifted_[r];
      const float reach = reachOf(r);
      if (!(dot(to, to) < reach * reach)) continue;
      if (change.removed >= 0 && counts(r)) continue;  // visited above
      visit(r);
    }
  }
}

double SubsetModel::tryChange(const Change& change) const {
  double delta = 0;
  forTouched(change, [&](uint32_t r) { delta += costWith(r, change) - costs_[r]; });
  return delta;
}

double SubsetModel::screenChange(const Change& change) const {
  // Judged points come in random order, so every n-th is a fair sample.
  double first = 0;
  std::vector<uint32_t> rest;
  forTouched(change, [&](uint32_t r) {
    if (r % kScreened == 0)
      first += costWith(r, change) - costs_[r];
    else
      rest.push_back(r);
  });
  if (first > 0) return first * kScreened;
  for (const uint32_t r : rest) first += costWith(r, change) - costs_[r];
  return first;
}

std::vector<uint32_t> SubsetModel::touched(const Change& change) const {
  std::vector<uint32_t> near, receivers;
  forTouched(change, [&](uint32_t r) { near.push_back(r); });
  std::sort(near.begin(), near.end());
  std::vector<uint8_t> altered(near.size());
  parallelFor(near.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      altered[i] = costWith(near[i], change) != costs_[near[i]];
  });
  for (std::size_t i = 0; i < near.size(); ++i)
    if (altered[i]) receivers.push_back(near[i]);
  return receivers;
}

void SubsetModel::refresh(std::span<const uint32_t> receivers) {
  parallelFor(receivers.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) costs_[receivers[i]] = costWith(receivers[i], {});
  });
}

// Puts a probe into a receiver's list if it is visible and near enough.
void SubsetModel::insertEntry(std::size_t receiver, int probe, const Pair& pair,
                              const float* values) {
  List& list = lists_[receiver];
  const bool is_nearer = list.entries.empty() || pair.distance < list.entries.back().distance;
  if (!is_nearer && list.entries.size() == kListed) list.complete = false;
  if (!pair.visible || !(is_nearer || list.complete)) return;
  int row = static_cast<int>(list.entries.size());
  if (list.entries.size() == kListed) {
    row = list.entries.back().row;
    std::erase(users_[static_cast<std::size_t>(list.entries.back().probe)],
               static_cast<uint32_t>(receiver));
    list.entries.pop_back();
    list.complete = false;
  } else {
    // Rows of removed entries are free again.
    std::array<bool, kListed> used{};
    for (const Entry& entry : list.entries) used[static_cast<std::size_t>(entry.row)] = true;
    row = static_cast<int>(std::find(used.begin(), used.end(), false) - used.begin());
  }
  const Entry entry{probe, row, pair.offset, pair.distance, pair.gain};
  const auto at =
      std::upper_bound(list.entries.begin(), list.entries.end(), entry,
                       [](const Entry& a, const Entry& b) { return a.distance < b.distance; });
  list.entries.insert(at, entry);
  std::copy_n(values, states_,
              &values_[(receiver * kListed + static_cast<std::size_t>(row)) * states_]);
  users_[static_cast<std::size_t>(probe)].push_back(static_cast<uint32_t>(receiver));
}

// Finds a receiver's list anew: nearest probes first, until it is full.
void SubsetModel::rebuild(std::size_t receiver) {
  List& list = lists_[receiver];
  for (const Entry& entry : list.entries)
    std::erase(users_[static_cast<std::size_t>(entry.probe)], static_cast<uint32_t>(receiver));
  list.entries.clear();
  list.complete = true;
  std::vector<std::pair<float, int>> order;
  for (const int p : alive_) {
    const Vec3f d = slots_[static_cast<std::size_t>(p)].position - lifted_[receiver];
    order.emplace_back(dot(d, d), p);
  }
  std::size_t sorted = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (list.entries.size() == kListed) {
      list.complete = false;
      break;
    }
    if (i == sorted) {  // sort a few more
      sorted = std::min(order.size(), std::max<std::size_t>(2 * sorted, 32));
      std::partial_sort(order.begin() + static_cast<std::ptrdiff_t>(i),
                        order.begin() + static_cast<std::ptrdiff_t>(sorted), order.end());
    }
    const int p = order[i].second;
    const BakedProbe& baked = slots_[static_cast<std::size_t>(p)];
    std::array<float, kMostStates> values;
    const Pair pair = pairOf(receiver, baked, values.data());
    insertEntry(receiver, p, pair, values.data());
  }
}

int SubsetModel::add(const BakedProbe& probe) {
  int index = static_cast<int>(slots_.size());
  if (!free_.empty()) {
    index = free_.back();
    free_.pop_back();
    slots_[static_cast<std::size_t>(index)] = probe;
  } else {
    slots_.push_back(probe);
    users_.emplace_back();
  }
  alive_.insert(std::upper_bound(alive_.begin(), alive_.end(), index), index);
  std::vector<uint32_t> reached;
  for (const std::vector<uint32_t>& receivers : cell_receivers_)
    for (const uint32_t r : receivers) {
      List& list = lists_[r];
      const bool open = list.entries.size() < kListed && list.complete;
      const Vec3f to = probe.position - lifted_[r];
      const float listed =
          open ? std::numeric_limits<float>::infinity() : list.entries.back().distance;
      if (dot(to, to) < listed * listed)
        reached.push_back(r);
      else
        list.complete = false;
    }
  std::vector<Pair> pairs(reached.size());
  std::vector<float> values(reached.size() * states_);
  parallelFor(reached.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      pairs[i] = pairOf(reached[i], probe, &values[i * states_]);
  });
  for (std::size_t i = 0; i < reached.size(); ++i)
    insertEntry(reached[i], index, pairs[i], &values[i * states_]);
  refresh(reached);
  findReaches();
  return index;
}

void SubsetModel::remove(int probe) {
  const auto p = static_cast<std::size_t>(probe);
  alive_.erase(std::lower_bound(alive_.begin(), alive_.end(), probe));
  const std::vector<uint32_t> users = std::move(users_[p]);
  users_[p].clear();
  const auto k = static_cast<std::size_t>(settings_.neighbours);
  for (const uint32_t r : users) {
    List& list = lists_[r];
    std::erase_if(list.entries, [&](const Entry& e) { return e.probe == probe; });
    if (!list.complete && list.entries.size() <= k + 1) rebuild(r);
  }
  refresh(users);
  free_.push_back(probe);
  findReaches();
}

void SubsetModel::findReaches() {
  for (std::size_t cell = 0; cell < cell_receivers_.size(); ++cell) {
    float reach = 0;
    for (const uint32_t r : cell_receivers_[cell]) reach = std::max(reach, reachOf(r));
    cell_reach_[cell] = reach;
  }
}

double SubsetModel::cost() const {
  double sum = 0;
  for (const double c : costs_) sum += c;
  return sum;
}

std::vector<Vec3f> SubsetModel::positions() const {
  std::vector<Vec3f> all;
  for (const int p : alive_) all.push_back(probe(p).position);
  return all;
}

}  // namespace probelab
