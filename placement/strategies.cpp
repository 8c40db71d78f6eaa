// SPDX-License-Identifier: GPL-3.0-or-later
#include <vector>

#include "base/error.h"
#include "base/suggest.h"
#include "base/timer.h"
#include "placement/grid.h"
#include "placement/strategy.h"

namespace probelab {
namespace {
constexpr int kMaxProbes = 1 << 24;
constexpr double kMinVertical = 0.25, kMaxVertical = 8;
}  // namespace

std::span<const Strategy> strategies() {
  static const std::vector<Strategy> all = {kGridStrategy};
  return all;
}

ProbeLayout placeProbes(const std::string& strategy, const PlacementInput& input) {
  if (input.probes < 1 || input.probes > kMaxProbes)
    throwInput("--probes {}: a layout takes 1 to {} probes", input.probes, kMaxProbes);
  if (!(input.vertical >= kMinVertical && input.vertical <= kMaxVertical))
    throwInput("--vertical {:g}: the vertical spacing may be {:g} to {:g} times the horizontal one",
               input.vertical, kMinVertical, kMaxVertical);
  std::vector<std::string> names;
  for (const Strategy& candidate : strategies()) {
    names.push_back(candidate.name);
    if (candidate.name != strategy) continue;
    const Timer timer;
    ProbeLayout layout = candidate.place(input);
    layout.strategy = strategy;
    layout.build_s = timer.seconds();
    return layout;
  }
  throwInput("unknown strategy '{}'{}", strategy, suggestion(strategy, names));
}

}  // namespace probelab
