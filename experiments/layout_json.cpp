// SPDX-License-Identifier: GPL-3.0-or-later
#include "layout_json.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace probelab {

Json latticeJson(const ProbeLayout& layout) {
  if (layout.interpolant != Interpolant::lattice) return nullptr;
  return {layout.lattice.count.x, layout.lattice.count.y, layout.lattice.count.z};
}

Json voxelsJson(const ProbeLayout& layout) {
  if (layout.interpolant == Interpolant::lattice) return nullptr;
  const Lattice& corners = layout.influence.corners;
  const auto edge = [&](std::size_t axis) { return static_cast<double>(corners.spacing[axis]); };
  return {{"count", {corners.count.x - 1, corners.count.y - 1, corners.count.z - 1}},
          {"edges_m", {edge(0), edge(1), edge(2)}}};
}

Json layoutJson(const ProbeLayout& layout) {
  return {{"interpolant", interpolantName(layout.interpolant)},
          {"voxels", voxelsJson(layout)},
          {"index_bytes", indexBytes(layout)},
          {"asked", layout.asked},
          {"seed", layout.seed},
          {"options", layout.options},
          {"evaluations", layout.evaluations},
          {"build_s", layout.build_s}};
}

std::string formatLayout(const Json& result) {
  std::string text = result["probes"]["stored"].dump() + " stored";
  if (!result["probes"].value("active", Json()).is_null())
    text += ", " + result["probes"]["active"].dump() + " active";
  text += ", " + result["strategy"].get<std::string>();
  const Json& lattice = result["lattice"];
  if (!lattice.is_null())
    return text +
           fmt::format(" of {} x {} x {}", lattice[0].dump(), lattice[1].dump(), lattice[2].dump());
  return text + ", interpolant " + result["layout"]["interpolant"].get<std::string>();
}

std::string formatOptions(const Json& options) {
  std::string text;
  for (const auto& [name, value] : options.items())
    text += (text.empty() ? "" : " ") + name + "=" + value.get<std::string>();
  return text.empty() ? "none" : text;
}

}  // namespace probelab
