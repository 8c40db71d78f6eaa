// SPDX-License-Identifier: GPL-3.0-or-later
// --ray-proxy: the simpler geometry that probe rays see, made, checked and reported.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "json.h"
#include "scene/ray_proxy.h"
#include "trace/embree_scene.h"
#include "trace/proxy_check.h"
#include "trace/wall_thickness.h"

namespace probelab {

// Not movable: `embree` is the proxy's.
struct ProxySetup {
  ProxySetup(const Scene& scene, const EmbreeScene& scene_embree, double asked_m, uint64_t seed);
  ProxySetup(const ProxySetup&) = delete;

  double asked_m;
  WallThickness wall;
  RayProxy proxy;
  EmbreeScene embree;
  ProxyCheck check;
};

// Empty when `asked_m` is 0. Throws Error (exit code 1) when the proxy lets light through a wall
// that blocks it in the scene.
std::unique_ptr<ProxySetup> makeProxySetup(const Scene& scene, const EmbreeScene& embree,
                                           double asked_m, uint64_t seed);

// {asked_m, bound_m, thinnest_wall_m, triangles_before, triangles_after, error_m, leaks, blocked,
// false_walls, free, hit_p99_m, build_s, left_alone}; null without a proxy.
Json proxyJson(const ProxySetup* setup);
// The same in a line; `json` is not null.
std::string formatProxy(const Json& json);

}  // namespace probelab
