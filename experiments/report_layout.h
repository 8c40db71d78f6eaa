// SPDX-License-Identifier: GPL-3.0-or-later
// A layout in its scene for the report's 3D view.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ddgi/layout.h"
#include "ddgi/probe_states.h"
#include "json.h"
#include "report_page.h"
#include "trace/embree_scene.h"

namespace probelab {

inline constexpr uint64_t kMostTriangles = 200'000;

struct ReportLayoutInput {
  const Scene& scene;
  const EmbreeScene& embree;
  const ProbeLayout& layout;
  ProbeStates states;  // where the probes are, and which are on
  std::string params;  // what settled the states; empty: they are as the layout has them
  std::string values;  // CSV of numbers a probe; empty: none
};

// One object: scene, strategy, interpolant, origin [3] (world position of the local origin), box
// {min, max} (local), triangles {shown, all, one_sided, positions, colors: blobs}, probes {count,
// positions: blob, states: blob, counts, params: text or null, moved, radius_m, values: [{name,
// unit, about, blob}]}.
//
// Positions are float triples in local coordinates, triangles one after the other with the
// one-sided ones first; colours are sRGB bytes a triangle; states are bytes: 0 active, 1 off, 2
// inside; values are floats, NaN where there is none. Of more than kMostTriangles triangles the
// largest are shown. The CSV has a line with names and one line a probe: its index, in the column
// "probe" or "index", and numbers. Throws InputError naming its line.
Json reportLayout(const ReportLayoutInput& input, ReportPage& page);

}  // namespace probelab
