// SPDX-License-Identifier: GPL-3.0-or-later
// How well a set of probes answers at the train receivers, kept up to date while probes are added,
// removed and moved one at a time. A receiver is answered by its k nearest visible probes with
// maximum-entropy weights, times facing and visibility as the field's query has them; a
// change touches only the receivers around it.
#pragma once

#include <span>
#include <vector>

#include "ddgi/params.h"
#include "placement/probe_bake.h"
#include "placement/training_data.h"

namespace probelab {

// Where probes are judged, and what is right there: train receivers, and what else a search adds.
struct JudgedPoints {
  std::vector<Receiver> points;  // areas sum to 1
  std::vector<float> truth;      // [point][state], irradiance / pi, luminance
};
JudgedPoints trainPoints(const Training::Data& data);

// What an estimate's error costs: sum over receivers and states of
// area * state_weight * ((1 - relative) d^2 / power + relative d^2 / ((E + 0.1 mean) mean)) with d
// the error of the irradiance E, and power and mean of the state's truth.
//
// Light that nobody trained on may fall anywhere, so gaps cost too, where `coverage` is above 0:
// area * coverage * max(0, d / covered_m - 1)^2, d the distance of the 4th nearest visible probe.
struct Objective {
  std::vector<double> state_weights;  // [state], sum 1
  double relative = 0;
  double coverage = 0;
  float covered_m = 1;
};

// Weight of a squared error where the truth is `e`, apart from the point's area.
double errorWeight(const Training::Data& data, const Objective& objective, std::size_t state,
                   double e);

// What the field's query makes of a probe at a point, apart from the interpolation weight: facing,
// visibility and crush; and the values that it averages, [state]. Moments and distances in metres
// (Params::variance_bias counts in units of the distance).
float queryGain(const QueryParams<float>& query, const QueryModes& modes, int moment_texels,
                const Receiver& receiver, const BakedProbe& probe, float bias_length_m);
void queryValues(const QueryModes& modes, int irradiance_texels, std::size_t states,
                 const Vec3f& direction, const BakedProbe& probe, float* values);
// The direction in which a point reads a probe: its normal, or with parallax aside of it.
Vec3f readDirection(const QueryParams<float>& query, const QueryModes& modes, int moment_texels,
                    const Receiver& receiver, const BakedProbe& probe);

struct SubsetSettings {
  int neighbours = 12;        // k
  float sharpness = 10;       // of the maximum-entropy kernel
  float bias_length_m = 0;    // nominal s_i of the layout to be
  float largest_reach_m = 0;  // a new probe farther away counts only where there is none
};

class SubsetModel {
 public:
  // References are kept.
  SubsetModel(const Training::Data& data, const JudgedPoints& judged, const Params& params,
              const BakePlan& plan, const SubsetSettings& settings, const Objective& objective);

  // A change: probe `removed` goes (-1: none), the baked one comes (null: none).
  struct Change {
    int removed = -1;
    const BakedProbe* added = nullptr;
  };
  // Cost after a change minus cost before; the state stays as it is. Safe to call in parallel.
  double tryChange(const Change& change) const;
  // The same where a sample of the receivers says that the cost falls; else an estimate of the
  // rise.
  double screenChange(const Change& change) const;
  // Receivers whose cost the change would alter, in ascending order.
  std::vector<uint32_t> touched(const Change& change) const;

  int add(const BakedProbe& probe);  // returns its index; indices of removed probes are used again
  void remove(int probe);

  const JudgedPoints& judged() const { return judged_; }
  double cost() const;
  // Share of the cost of one receiver.
  double costAt(std::size_t receiver) const { return costs_[receiver]; }
  std::size_t receiverCount() const { return judged_.points.size(); }
  const std::vector<int>& probes() const { return alive_; }  // indices in use, ascending
  const BakedProbe& probe(int index) const { return slots_[static_cast<std::size_t>(index)]; }
  std::vector<Vec3f> positions() const;  // of the probes in use

 private:
  struct Entry {
    int probe;
    int row;               // of values_, within the receiver's
    Vec3f offset;          // from the receiver
    float distance, gain;  // gain: facing, visibility and crush
  };
  struct List {  // a receiver's nearest visible probes, by distance
    std::vector<Entry> entries;
    bool complete = true;  // there are no more
  };
  struct Pair {  // a probe seen from a receiver
    Vec3f offset;
    float distance = 0, gain = 0;
    bool visible = false;
  };
  Pair pairOf(std::size_t receiver, const BakedProbe& probe, float* values) const;
  // Returns the distance that coverage looks at, in metres.
  float estimateWith(std::size_t receiver, const Change& change, std::span<float> estimate) const;
  double costWith(std::size_t receiver, const Change& change) const;
  template <class Visit>
  void forTouched(const Change& change, const Visit& visit) const;
  void rebuild(std::size_t receiver);
  void insertEntry(std::size_t receiver, int probe, const Pair& pair, const float* values);
  void refresh(std::span<const uint32_t> receivers);
  void findReaches();
  float reachOf(std::size_t receiver) const;

  const Training::Data& data_;
  const JudgedPoints& judged_;
  QueryParams<float> query_;
  QueryModes modes_;
  const BakePlan& plan_;
  SubsetSettings settings_;
  std::size_t states_;
  double coverage_;
  float covered_m_;
  std::vector<float> weights_;  // [receiver][state]
  std::vector<Vec3f> lifted_;   // [receiver], off its surface
  std::vector<BakedProbe> slots_;
  std::vector<int> alive_, free_;
  std::vector<std::vector<uint32_t>> users_;  // [probe]: receivers that list it
  std::vector<List> lists_;                   // [receiver]
  std::vector<float> values_;                 // [receiver][entry][state]
  std::vector<double> costs_;                 // [receiver]
  // Receivers by cells, to find those that a new probe reaches.
  Box3f box_;
  Vec3i cells_;
  Vec3f cell_size_;
  std::vector<std::vector<uint32_t>> cell_receivers_;
  std::vector<float> cell_reach_;  // largest reach in the cell
};

}  // namespace probelab
