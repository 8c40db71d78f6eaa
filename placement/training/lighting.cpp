// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement/lighting.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/rng.h"
#include "trace/light_data.h"
#include "trace/sampling.h"

namespace probelab {
namespace {

constexpr int kTries = 48;          // points or directions that compete for one lamp or sun
constexpr float kWallShare = 0.2f;  // of the room's size that a lamp keeps from surfaces
constexpr float kLowestSun = 0.12f, kHighestSun = 0.97f;  // sine of its height

// Free distance to the nearest surface along a few directions.
float roomAround(const EmbreeScene& embree, const Vec3f& p, Rng& rng) {
  float nearest = kFarDistance;
  for (int i = 0; i < 32; ++i)
    nearest = std::min(
        nearest,
        embree.closest(Ray{p, 0, sampleSphere({rng.nextFloat(), rng.nextFloat()}), kFarDistance})
            .t);
  return nearest;
}

std::vector<int32_t> reachableCells(const Reachability& reachability) {
  std::vector<int32_t> cells;
  for (std::size_t i = 0; i < reachability.cell_region.size(); ++i) {
    const int32_t region = reachability.cell_region[i];
    if (region >= 0 && reachability.regions[static_cast<std::size_t>(region)].reachable)
      cells.push_back(static_cast<int32_t>(i));
  }
  return cells;
}

// Points that keep away from those chosen so far and, a little, from surfaces.
std::vector<Vec3f> lampPositions(const EmbreeScene& embree, const Reachability& reachability,
                                 int count, Rng& rng) {
  const std::vector<int32_t> cells = reachableCells(reachability);
  std::vector<Vec3f> lamps;
  while (!cells.empty() && static_cast<int>(lamps.size()) < count) {
    Vec3f best;
    float best_score = -1;
    for (int i = 0; i < kTries; ++i) {
      const Vec3f p = reachability.cellCenter(cells[rng.nextBelow(cells.size())]);
      float apart = length(reachability.reachable_box.extent());
      for (const Vec3f& lamp : lamps) {
        // Behind a wall is as good as farther away.
        const Vec3f to = lamp - p;
        const float d = length(to);
        if (d >= apart) continue;
        const bool hidden = d > 0 && embree.occluded(Ray{p, 0, to / d, d});
        apart = std::min(apart, hidden ? 2 * d : d);
      }
      const float room = std::min(roomAround(embree, p, rng), kWallShare * apart);
      const float score = apart * std::min(1.0f, room / (kWallShare * apart + 1e-20f));
      if (score > best_score) best_score = score, best = p;
    }
    lamps.push_back(best);
  }
  return lamps;
}

// Share of the reachable space that sees a direction.
double seenFrom(const EmbreeScene& embree, const Reachability& reachability,
                const std::vector<int32_t>& cells, const Vec3f& to_sun, Rng& rng) {
  constexpr int kRays = 256;
  int seen = 0;
  for (int i = 0; i < kRays; ++i) {
    const Vec3f p = reachability.cellCenter(cells[rng.nextBelow(cells.size())]);
    seen += embree.occluded(Ray{p, 0, to_sun, kFarDistance}) ? 0 : 1;
  }
  return static_cast<double>(seen) / kRays;
}

// Directions towards the sun, apart from each other; those that light much of the space win.
std::vector<Vec3f> sunDirections(const EmbreeScene& embree, const Reachability& reachability,
                                 int count, Rng& rng) {
  const std::vector<int32_t> cells = reachableCells(reachability);
  std::vector<Vec3f> suns;
  while (!cells.empty() && static_cast<int>(suns.size()) < count) {
    Vec3f best(0, 1, 0);
    double best_score = -1;
    for (int i = 0; i < kTries; ++i) {
      const float y = kLowestSun + (kHighestSun - kLowestSun) * rng.nextFloat();
      const float phi = 2 * kPi * rng.nextFloat(), r = std::sqrt(1 - y * y);
      const Vec3f d(r * std::cos(phi), y, r * std::sin(phi));
      double apart = 2;
      for (const Vec3f& sun : suns) apart = std::min(apart, 1 - static_cast<double>(dot(sun, d)));
      const double score =
          std::sqrt(seenFrom(embree, reachability, cells, d, rng)) * std::sqrt(apart);
      if (score > best_score) best_score = score, best = d;
    }
    suns.push_back(best);
  }
  return suns;
}

// What kinds of light the scene's states have.
struct Kinds {
  bool lamps = false, suns = false, sky = false;
};

Kinds addOwnStates(const Scene& scene, const LightingPlan& plan, std::vector<Lighting>& all) {
  Kinds kinds;
  for (const LightingState& state : scene.states) {
    const Scene lit = withState(scene, state.name);
    const Lighting own{state.name, true, makeLightData(lit), lit.sky.scale};
    kinds.sky = kinds.sky || !lit.sky.black();
    for (const LightData& light : own.lights)
      (light.type == kLightDirectional ? kinds.suns : kinds.lamps) = true;
    if (plan.own && state.split == plan.split) all.push_back(own);
  }
  if (!kinds.suns && !kinds.lamps) kinds.lamps = true;
  return kinds;
}

Lighting sunState(const Vec3f& to_sun, bool has_sky, Rng& rng) {
  LightData light{};
  light.intensity = Vec3f(1.0f + 9.0f * rng.nextFloat());
  light.type = kLightDirectional;
  light.direction = -to_sun;
  return {"sun", false, {light}, has_sky ? 0.2f + 0.9f * rng.nextFloat() : 0.0f};
}

// Half of the states have one lamp, so that rooms are dark in some; the lamps of the others are
// dealt out in the order that they were chosen in, so that those of a state are apart.
void addLampStates(const EmbreeScene& embree, const Reachability& reachability, int states,
                   int lamps_each, Rng& rng, std::vector<Lighting>& all) {
  const int shared = lamps_each > 1 ? states - states / 2 : 0, single = states - shared;
  const std::size_t first = all.size();
  int i = 0;
  for (const Vec3f& p :
       lampPositions(embree, reachability, single + shared * lamps_each, rng)) {
    const int state = i < single || shared == 0 ? i : single + (i - single) % shared;
    if (first + static_cast<std::size_t>(state) == all.size())
      all.push_back({"lamp", false, {}, 0.0f});
    LightData light{};
    light.intensity = Vec3f(1);
    light.type = kLightPoint;
    light.position = p;
    all[first + static_cast<std::size_t>(state)].lights.push_back(light);
    ++i;
  }
}

}  // namespace

std::vector<Lighting> trainingLighting(const Scene& scene, const EmbreeScene& embree,
                                       const Reachability& reachability,
                                       const LightingPlan& plan) {
  std::vector<Lighting> all;
  const Kinds kinds = addOwnStates(scene, plan, all);
  if (all.size() > kMostStates)
    throwInput("{}: a layout cannot be trained under its {} lighting states; {} are the most",
               scene.path, all.size(), kMostStates);
  Rng rng(plan.seed, RngStream::placement, 1);
  const int generated = std::min(plan.generated, static_cast<int>(kMostStates - all.size()));
  const int skies = kinds.sky && generated > 0 ? 1 : 0;
  const int suns = kinds.suns ? (generated - skies) / (kinds.lamps ? 2 : 1) : 0;
  const int lamps = kinds.lamps ? generated - skies - suns : 0;
  if (skies > 0) all.push_back({"sky", false, {}, 1.0f});
  for (const Vec3f& d : sunDirections(embree, reachability, suns, rng))
    all.push_back(sunState(d, kinds.sky, rng));
  addLampStates(embree, reachability, lamps, plan.lamps_each, rng, all);
  return all;
}

}  // namespace probelab
