// SPDX-License-Identifier: GPL-3.0-or-later
// Which points read which probes, and the shared query over values that belong to such pairs in
// place of texels.
#pragma once

#include <span>
#include <vector>

#include "tuning/field_view.h"

namespace probelab {

// Pairs lie in the order of the points.
struct ProbePairs {
  std::vector<uint32_t> begin;        // [point + 1]: first pair of a point
  std::vector<int> probe;             // [pair]
  std::vector<uint32_t> point;        // [pair]
  std::vector<uint32_t> probe_begin;  // [probe + 1]: first place of a probe in of_probe
  std::vector<uint32_t> of_probe;     // pairs, by probe
  std::vector<int> used;              // probes with a pair, ascending
};

// The probes that the query of each point fetches, whatever their texels are: where they are looked
// up depends on biases, modes and layout alone.
ProbePairs pairPoints(const FieldSnapshot& field, std::span<const QueryPoint> points);

// From the probe to where it is read, as the query takes it: direction (unit) and distance.
Vec3d readingOffset(const FieldSnapshot& field, const QueryPoint& point, int probe);

// The direction in which the query at a point reads a probe's irradiance: the normal, or with
// parallax aside of it; `ahead_m`: mean distance that the probe sees along the normal.
Vec3f readingDirection(const FieldSnapshot& field, const QueryPoint& point, int probe,
                       double ahead_m);

// The query at a point with one value of irradiance and one of moments a pair in place of maps.
// Values are as stored; `params` decodes them.
Vec3f queryPairs(const FieldSnapshot& field, const QueryParams<double>& params,
                 const QueryModes& modes, const ProbePairs& pairs,
                 std::span<const QueryPoint> points, std::size_t point,
                 std::span<const Vec3f> irradiance, std::span<const Vec2d> moments);

}  // namespace probelab
