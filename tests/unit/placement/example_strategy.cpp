// SPDX-License-Identifier: GPL-3.0-or-later
// An example strategy, `layers`: probes on a square raster at two heights above the floor. README
// says how one like it joins the program.
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "placement/grid.h"
#include "placement/scattered.h"

namespace probelab {
namespace {

// The usable places of x by z columns at both heights above the lowest reachable point.
std::vector<Vec3f> layers(const FreeSpace& space, const Box3f& box, const Vec3i& columns,
                          const std::vector<float>& heights) {
  std::vector<Vec3f> places;
  const Vec3f edge = box.extent() / Vec3f(columns);
  for (const float height : heights)
    for (int z = 0; z < columns.z; ++z)
      for (int x = 0; x < columns.x; ++x) {
        Vec3f p = box.min + Vec3f(Vec3i(x, 0, z)) * edge + edge * 0.5f;
        p.y = box.min.y + height;
        if (space.usable(p)) places.push_back(p);
      }
  return places;
}

ProbeLayout placeLayers(const PlacementInput& input) {
  const std::vector<float> heights = {static_cast<float>(numberOption(input, "low", 0.01, 1e3)),
                                      static_cast<float>(numberOption(input, "high", 0.01, 1e3))};
  if (heights[0] >= heights[1]) throwInput("--option low: must be below high");
  const FreeSpace space(input);
  const Box3f box = outerBox(input, {true});
  const Vec3f edges = box.extent();

  // More and more columns, as near to squares as they get, until far too many places are free.
  const auto most = static_cast<std::size_t>(input.probes);
  std::vector<Vec3f> best = {space.roomiest()};
  for (int columns = 1; columns < 4 * input.probes + 8; columns += 1 + columns / 20) {
    const int x =
        std::max(1, static_cast<int>(std::lround(std::sqrt(columns * edges.x / edges.z))));
    std::vector<Vec3f> places = layers(space, box, {x, 1, std::max(1, columns / x)}, heights);
    if (places.size() > 2 * most) break;
    if (places.size() <= most && places.size() >= best.size()) best = std::move(places);
  }
  return scatterProbes(space, std::move(best));
}

}  // namespace

extern const Strategy kLayersStrategy;
const Strategy kLayersStrategy = {
    "layers", "a square raster of probes at two heights above the floor",
    scatteredOptions({{"low", "0.5", "0.01 .. 1000", "height of the lower probes, metres"},
                      {"high", "1.6", "0.01 .. 1000", "height of the upper ones, metres"}}),
    placeLayers};

}  // namespace probelab
